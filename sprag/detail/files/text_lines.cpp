#include "sprag/detail/files/text_lines.h"

#include <system_error>

#include "sprag/detail/files/input_file.h"

namespace sprag {

std::string read_regular_text(const std::filesystem::path& file) {
  std::error_code error;
  const auto type = std::filesystem::status(file, error).type();
  if (type != std::filesystem::file_type::regular &&
      type != std::filesystem::file_type::not_found) {
    throw InputError(file.string() + ": is not a regular file; must be one");
  }
  std::string text = read_whole(file);
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  return text;
}

bool TextLines::next() {
  if (rest_.empty()) return false;
  ++number_;
  const std::size_t end = rest_.find_first_of("\r\n");
  line_ = rest_.substr(0, end);
  if (end == std::string_view::npos) {
    rest_ = {};
  } else {
    rest_.remove_prefix(end + (rest_.substr(end, 2) == "\r\n" ? 2 : 1));
  }
  return true;
}

bool TextLines::next_data(std::string_view comments) {
  while (next()) {
    const std::size_t first = line_.find_first_not_of(" \t");
    if (first == std::string_view::npos) continue;
    if (comments.find(line_[first]) == std::string_view::npos) return true;
  }
  return false;
}

}  // namespace sprag
