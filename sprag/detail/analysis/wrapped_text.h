// Text for people in lines of at most 100 characters.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sprag {

/// Appends words that are a blank apart to the line that the text ends with, goes on in lines that
/// begin with `margin` blanks, and ends the last one. A longer word has a line for itself.
void append_wrapped(std::string& text, std::string_view words, std::size_t margin = 0);

}  // namespace sprag
