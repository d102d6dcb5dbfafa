// The word that somebody meant, for messages about one that does not exist.
#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace sprag {

/// The candidate with the fewest typing errors (letters inserted, left out, replaced, or swapped
/// with their neighbour; case is ignored), the first of equals. None if more than every third
/// letter is wrong.
std::optional<std::string_view> nearest_word(std::string_view word,
                                             std::span<const std::string_view> candidates);

}  // namespace sprag
