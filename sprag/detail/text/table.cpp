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

void append_wrapped(std::string& text, std::string_view words, std::size_t margin) {
  constexpr std::size_t columns = 100;
  std::size_t used = text.size() - (text.rfind('\n') + 1);
  bool fresh = true;
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(' '));
    words.remove_prefix(std::min(word.size() + 1, words.size()));
    if (!fresh && used + 1 + word.size() > columns) {
      text += '\n';
      text.append(margin, ' ');
      used = margin;
      fresh = true;
    }
    if (!fresh) text += ' ';
    text += word;
    used += word.size() + (fresh ? 0 : 1);
    fresh = false;
  }
  text += '\n';
}

}  // namespace sprag
