// Tables in text for users.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace sprag {

/// Appends a line of cells. Each but the last is filled with blanks to its width, and at least one
/// blank separates it from the next.
void append_row(std::string& text, std::span<const std::size_t> widths,
                const std::vector<std::string>& cells);

}  // namespace sprag
