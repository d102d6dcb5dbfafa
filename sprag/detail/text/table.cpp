#include "sprag/detail/text/table.h"

#include <algorithm>

namespace sprag {

void append_row(std::string& text, std::span<const std::size_t> widths,
                const std::vector<std::string>& cells) {
  std::string row;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    std::string cell = cells[i];
    if (i + 1 < cells.size()) cell.resize(std::max(widths[i], cell.size() + 1), ' ');
    row += cell;
  }
  while (!row.empty() && row.back() == ' ') row.pop_back();
  text += row + '\n';
}

}  // namespace sprag
