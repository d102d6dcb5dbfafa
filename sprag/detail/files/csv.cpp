#include "sprag/detail/files/csv.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

namespace sprag {

namespace {

// A row of 20 000 coordinates is shorter. A longer line is not a CSV file of this program.
constexpr std::size_t longest_line = 1U << 20U;
constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

template <class Number>
std::optional<Number> parse(std::string_view field) {
  field = trimmed(field);
  const bool signed_number = field.size() > 1 && (field[1] == '-' || field[1] == '+');
  if (field.starts_with('+') && !signed_number) field.remove_prefix(1);
  Number number{};
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), number);
  if (error != std::errc{} || end != field.data() + field.size()) return std::nullopt;
  return number;
}

}  // namespace

void append_number(std::string& text, double value) {
  std::array<char, 32> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value,
                                 std::chars_format::general, 17)
                       .ptr;
  text.append(digits.data(), end);
}

void append_number(std::string& text, std::int64_t value) {
  std::array<char, 24> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

std::optional<double> parse_double(std::string_view field) {
  const auto number = parse<double>(field);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

std::optional<std::int64_t> parse_integer(std::string_view field) {
  return parse<std::int64_t>(field);
}

void split_fields(std::string_view line, std::vector<std::string_view>& fields, char separator) {
  fields.clear();
  for (std::size_t end = line.find(separator); end != std::string_view::npos;
       end = line.find(separator)) {
    fields.push_back(line.substr(0, end));
    line.remove_prefix(end + 1);
  }
  fields.push_back(line);
}

void split_words(std::string_view line, std::vector<std::string_view>& words,
                 std::string_view blanks) {
  words.clear();
  for (auto begin = line.find_first_not_of(blanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(blanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(blanks, end);
  }
}

std::string_view trimmed(std::string_view text, std::string_view blanks) {
  text.remove_prefix(std::min(text.find_first_not_of(blanks), text.size()));
  return text.substr(0, text.find_last_not_of(blanks) + 1);
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return lower;
}

// Position of the first of `characters` in the unread bytes, npos if there is none. `bytes`: the
// bytes searched.
std::size_t LineReader::find(std::string_view characters, std::string_view& bytes) {
  bytes = file_.ahead(1);
  std::size_t at = bytes.find_first_of(characters);
  while (at == std::string_view::npos) {
    const std::size_t seen = bytes.size();
    if (seen >= longest_line) break;
    bytes = file_.ahead(seen + 1);
    if (bytes.size() == seen) break;
    at = bytes.find_first_of(characters, seen);
  }
  return at;
}

void LineReader::find_end_of_line() {
  std::string_view bytes;
  const std::size_t at = find("\r\n", bytes);
  end_of_line_ = "\n";
  if (at == std::string_view::npos || bytes[at] == '\n') return;
  bytes = file_.ahead(at + 2);
  if (bytes.size() == at + 1 || bytes[at + 1] != '\n') end_of_line_ = "\r";
}

LineReader::Result LineReader::next(std::string_view& line) {
  file_.skip(std::exchange(shown_, 0));
  if (number_ == 0) {
    if (file_.ahead(byte_order_mark.size()).starts_with(byte_order_mark)) {
      file_.skip(byte_order_mark.size());
    }
    find_end_of_line();
  }
  std::string_view bytes;
  const std::size_t end = find(end_of_line_, bytes);
  if (file_.failed() && end == std::string_view::npos) return Result::unreadable;
  if (bytes.empty()) return Result::end;
  ++number_;
  if (std::min(end, bytes.size()) >= longest_line) return Result::too_long;
  if (end == std::string_view::npos) return Result::truncated;
  shown_ = end + 1;
  line = bytes.substr(0, end);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return Result::line;
}

std::string describe(LineReader::Result result) {
  switch (result) {
    case LineReader::Result::truncated:
      return "truncated line (no end of line)";
    case LineReader::Result::too_long:
      return "line longer than 1 MiB";
    case LineReader::Result::unreadable:
      return "cannot be read";
    case LineReader::Result::end:
      return "end of file";
    case LineReader::Result::line:
      break;
  }
  return "line";
}

}  // namespace sprag
