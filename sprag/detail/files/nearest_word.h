// Suggestion for a misspelled word, for messages about unknown keys and names.
#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace sprag {

/// The candidate with the fewest edits (insertion, deletion, replacement, swap of neighbours; case
/// is ignored), the first if several are equal. None if more than a third of the letters differ.
std::optional<std::string_view> nearest_word(std::string_view word,
                                             std::span<const std::string_view> candidates);

}  // namespace sprag
