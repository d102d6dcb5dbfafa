#include "sprag/detail/import/column_file.h"

#include <algorithm>
#include <array>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/import/clock_time.h"
#include "sprag/detail/import/decimal.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {

namespace {

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

std::string_view trimmed(std::string_view field) {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t begin = field.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return field.substr(begin, field.find_last_not_of(blanks) - begin + 1);
}

std::string located(const std::string& file, std::size_t line, const std::string& what) {
  return file + ":" + std::to_string(line) + ": " + what;
}

/// The lines that are neither empty nor comments.
class Lines {
 public:
  explicit Lines(std::string_view text)
      : rest_(text), end_(text.find('\n') == std::string_view::npos ? '\r' : '\n') {
    if (rest_.starts_with(byte_order_mark)) rest_.remove_prefix(byte_order_mark.size());
  }

  std::optional<std::string_view> next() {
    while (!rest_.empty()) {
      const std::size_t end = std::min(rest_.find(end_), rest_.size());
      const std::string_view line = rest_.substr(0, end);
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      ++number_;
      const std::string_view content = trimmed(line);
      if (!content.empty() && content.front() != '#') return line;
    }
    return std::nullopt;
  }

  /// Number of the line that next() returned last, from 1.
  std::size_t number() const { return number_; }

 private:
  std::string_view rest_;
  char end_;  // end of a line: CR in a file without LF
  std::size_t number_ = 0;
};

/// Length of the field at the beginning of `text`, up to its separator; nullopt if a quote is not
/// closed. A doubled quote closes and reopens the quotes, which gives the same length.
std::optional<std::size_t> field_length(std::string_view text, char separator) {
  const std::size_t first = text.find_first_not_of(' ');
  bool in_quotes = false;
  if (first == std::string_view::npos || text[first] != '"')
    return std::min(text.find(separator), text.size());
  for (std::size_t i = first; i < text.size(); ++i) {
    if (text[i] == '"') in_quotes = !in_quotes;
    if (text[i] == separator && !in_quotes) return i;
  }
  return in_quotes ? std::nullopt : std::optional(text.size());
}

/// Content of a field: without surrounding blanks and quotes.
std::string_view content_of(std::string_view field) {
  field = trimmed(field);
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
    field = trimmed(field.substr(1, field.size() - 2));
  return field;
}

}  // namespace

bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  while (true) {
    const auto length = field_length(line, separator);
    if (!length) return false;
    fields.push_back(content_of(line.substr(0, *length)));
    if (*length == line.size()) return true;
    line.remove_prefix(*length + 1);
  }
}

namespace {

char separator_of(std::string_view header) {
  std::vector<std::string_view> fields;
  for (const char candidate : {'\t', ';', ','}) {
    if (split_line(header, candidate, fields) && fields.size() > 1) return candidate;
  }
  return ';';
}

std::string unquoted(std::string_view name) {
  std::string text(name);
  for (std::size_t i = text.find("\"\""); i != std::string::npos; i = text.find("\"\"", i + 1))
    text.erase(i, 1);
  return text;
}

std::string fields_text(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " field" : " fields");
}

}  // namespace

std::string quoted(const std::string& name) { return "'" + name + "'"; }

std::string to_text(const RowProblem& problem) {
  const std::string line = std::to_string(problem.line) + ": ";
  return line + (problem.column.empty() ? "" : "column " + problem.column + ": ") + problem.what;
}

std::size_t ColumnFile::find(std::string_view name, const std::string& file) const {
  const auto named = [&](const Column& column) { return column.name == name; };
  const auto found = std::ranges::find_if(columns, named);
  if (found != columns.end() && std::find_if(found + 1, columns.end(), named) == columns.end())
    return static_cast<std::size_t>(found - columns.begin());
  std::string what = file + (found == columns.end() ? ": there is no column '"
                                                    : ": there is more than one column '");
  what.append(name).append("'");
  std::vector<std::string_view> names;
  for (const Column& column : columns) names.emplace_back(column.name);
  if (found == columns.end()) {
    const auto nearest = nearest_word(name, names);
    if (nearest) what.append(" (did you mean '").append(*nearest).append("'?)");
  }
  what += "; the columns are ";
  for (const std::string_view& other : names)
    what.append(&other == names.data() ? "'" : ", '").append(other).append("'");
  throw InputError(what);
}

std::optional<char> parse_separator(std::string_view text) {
  if (text == "comma" || text == ",") return ',';
  if (text == "semicolon" || text == ";") return ';';
  if (text == "tab" || text == "\t") return '\t';
  return std::nullopt;
}

namespace {

// Reads the separator and the names of the columns from the first line.
ColumnFile read_header(Lines lines, const std::string& file, std::optional<char> separator) {
  const auto header = lines.next();
  if (!header) throw InputError(located(file, 1, "there is no header with the columns' names"));
  ColumnFile result;
  result.separator = separator.value_or(separator_of(*header));
  std::vector<std::string_view> fields;
  if (!split_line(*header, result.separator, fields))
    throw InputError(located(file, lines.number(), "a quote in the header is not closed"));
  if (std::ranges::all_of(fields, [](std::string_view field) {
        return field.empty() || parse_decimal(field, DecimalMark::point_or_comma);
      }))
    throw InputError(
        located(file, lines.number(),
                "must be the header with the columns' names; has only numbers (a line that "
                "starts with # is a comment). In a file without a header --columns NAME,... names "
                "the columns"));
  for (const std::string_view name : fields) result.columns.push_back({unquoted(name), {}});
  return result;
}

// Determines the separator if the first line contains data and the names are specified.
ColumnFile name_columns(Lines lines, const std::string& file, std::optional<char> separator,
                        const std::vector<std::string>& names) {
  ColumnFile result;
  const std::string_view first = lines.next().value_or("");
  std::vector<std::string_view> fields;
  const auto makes_as_many = [&](char candidate) {
    return split_line(first, candidate, fields) && fields.size() == names.size();
  };
  const bool one_time =
      parse_clock_time(content_of(first), DecimalMark::point_or_comma).has_value();
  constexpr std::array candidates{'\t', ';', ','};
  const auto* const found = std::ranges::find_if(candidates, makes_as_many);
  const bool many = names.size() > 1 && found != candidates.end();
  result.separator = separator.value_or(many ? *found : one_time ? ';' : separator_of(first));
  if (!makes_as_many(result.separator)) {
    throw InputError(located(file, std::max<std::size_t>(lines.number(), 1),
                             "has " + fields_text(fields.size()) + "; --columns names " +
                                 std::to_string(names.size()) +
                                 (names.size() == 1 ? " column" : " columns")));
  }
  for (const std::string& name : names) result.columns.push_back({name, {}});
  return result;
}

}  // namespace

ColumnFile parse_columns(std::string_view text, const std::string& file,
                         std::optional<char> separator, const std::vector<std::string>& names) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    throw InputError(located(file, 1, "is UTF-16; must be UTF-8 or ASCII"));
  Lines lines(text);
  ColumnFile result = names.empty() ? read_header(lines, file, separator)
                                    : name_columns(lines, file, separator, names);
  if (names.empty()) lines.next();
  std::vector<std::string_view> fields;
  while (const auto line = lines.next()) {
    check_interrupt();
    if (!split_line(*line, result.separator, fields)) {
      result.problems.push_back({lines.number(), "", "a quote is not closed"});
      continue;
    }
    if (fields.size() != result.columns.size()) {
      result.problems.push_back({lines.number(), "",
                                 "has " + fields_text(fields.size()) +
                                     (names.empty() ? "; the header has " : "; --columns has ") +
                                     std::to_string(result.columns.size())});
      continue;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (!fields[i].empty()) result.columns[i].cells.push_back({lines.number(), fields[i]});
    }
  }
  return result;
}

}  // namespace sprag
