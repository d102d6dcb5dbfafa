// Tables and paragraphs in text for users.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

/// Appends a line of cells. Each but the last is filled with blanks to its width, and at least one
/// blank separates it from the next.
void append_row(std::string& text, std::span<const std::size_t> widths,
                const std::vector<std::string>& cells);

/// Appends words, separated by single blanks, to the last line of the text, which has at most 100
/// characters. Further lines begin with `margin` blanks, and the last one is ended. A word that is
/// too long has a line of its own.
void append_wrapped(std::string& text, std::string_view words, std::size_t margin = 0);

}  // namespace sprag
