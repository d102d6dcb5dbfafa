// Wraps text for users to lines of at most 100 characters.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sprag {

/// Appends words, separated by single blanks, to the last line of the text. Further lines begin
/// with `margin` blanks, and the last one is ended. A word that is too long has a line of its own.
void append_wrapped(std::string& text, std::string_view words, std::size_t margin = 0);

}  // namespace sprag
