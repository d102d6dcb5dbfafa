#include "sprag/detail/files/record_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/files/text_lines.h"
#include "sprag/detail/files/toml_reader.h"

namespace sprag {
namespace {

constexpr std::size_t fewest_samples = 4;
// An interval longer than this times the usual one is a gap, if most intervals are alike.
constexpr double gap_factor = 1.5;
constexpr double alike = 0.1;
constexpr double share_of_alike = 0.9;
// Names of units of time, in lower case, and how many of them are one second; 0: unknown.
constexpr std::array<std::pair<std::string_view, double>, 5> time_units{
    {{" s sec second seconds ", 1.0},
     {" ms msec millisecond milliseconds ", 1e3},
     {" us usec \u00B5s \u03BCs microsecond microseconds ", 1e6},
     {" ns nsec nanosecond nanoseconds ", 1e9},
     {" ps fs min minutes h hours d days ticks counts samples cycles frames ", 0.0}}};
// Other units that a row of units may have without brackets, in lower case.
constexpr std::string_view signal_units =
    " v mv volt volts a ma g m/s\u00B2 m/s^2 m/s2 pa n kn mm m db % deg \u00B0c c unitless logic ";
// Lines above the rows that are looked at.
constexpr std::size_t longest_head = 1000;
// First bytes of files that import_events converts.
constexpr std::array<std::pair<std::string_view, const char*>, 6> kinds{
    {{"\x93NUMPY", "a numpy array"},
     {"MATLAB 5.0", "a MATLAB file"},
     {"PK\x03\x04", "an Excel file or a zip archive"},
     {"RIFF", "a sound"},
     {"\xFF\xFE", "a text in UTF-16"},
     {"\xFE\xFF", "a text in UTF-16"}}};
constexpr std::size_t looked_at = 4000;  // bytes

constexpr std::string_view blanks_and_quotes = " \t\"'";

// Whether a line's commas are decimal ones between columns separated by blanks, as in "0,25 1,5".
bool is_blank_separated(std::string_view line) {
  const auto digit = [&](std::size_t i) {
    return i < line.size() && line[i] >= '0' && line[i] <= '9';
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == ',' && !(i > 0 && digit(i - 1) && digit(i + 1))) return false;
  }
  const auto first = line.find_first_not_of(' ');
  const auto last = line.find_last_not_of(' ');
  return first != std::string_view::npos &&
         line.substr(first, last - first).find(' ') != std::string_view::npos;
}

// Separator of a file's columns by its first line; ' ': any number of blanks.
char separator_of(std::string_view line) {
  for (const char separator : {';', '\t'}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return is_blank_separated(line) ? ' ' : ',';
}

bool is_among(std::string_view word, std::string_view names) {
  return !word.empty() && names.find(" " + lower_case(word) + " ") != std::string_view::npos;
}

// Units per second of a unit of time; 0: an unknown length, none: not a unit of time.
std::optional<double> per_second(std::string_view unit) {
  for (const auto& [names, count] : time_units) {
    if (is_among(unit, names)) return count;
  }
  return std::nullopt;
}

// The unit in the name of a column of times: "Time [ms]", "t (us)", "t / ns", "t_ms", "t in ms",
// "microseconds"; empty: none.
std::string unit_in(const std::string& name) {
  std::size_t begin = name.find_last_of("[(/_");
  if (begin == std::string::npos) begin = name.rfind(" in ");
  if (begin == std::string::npos && name.size() <= 2) return {};
  begin = begin == std::string::npos ? 0 : name[begin] == ' ' ? begin + 4 : begin + 1;
  const std::string_view rest(name.data() + begin, name.size() - begin);
  const std::string unit(trimmed(rest.substr(0, rest.find_first_of("])")), blanks_and_quotes));
  return per_second(unit) ? unit : std::string();
}

// The unit in a cell of a row of units, "(ms)", "[V]", "g"; none: the cell is no unit.
std::optional<std::string> unit_of_cell(const std::string& cell) {
  const bool in_brackets = cell.size() > 1 && ((cell.front() == '(' && cell.back() == ')') ||
                                               (cell.front() == '[' && cell.back() == ']'));
  std::string unit = in_brackets ? cell.substr(1, cell.size() - 2) : cell;
  if (!in_brackets && !unit.empty() && !per_second(unit) && !is_among(unit, signal_units)) {
    return std::nullopt;
  }
  return unit;
}

std::vector<std::string_view> split(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  if (separator == ' ') {
    split_words(line, fields, " ");
  } else {
    split_fields(line, fields, separator);
  }
  return fields;
}

// A number with a decimal point, or a decimal comma if commas do not separate.
std::optional<double> parse(std::string_view field, char separator) {
  const std::size_t comma = separator == ',' ? std::string_view::npos : field.find(',');
  if (comma == std::string_view::npos) return parse_double(field);
  std::string with_point(field);
  with_point[comma] = '.';
  return parse_double(with_point);
}

// The first column with a number; none: there is no number.
std::optional<std::size_t> first_number(std::string_view line, char separator) {
  const auto fields = split(line, separator);
  const auto found = std::find_if(fields.begin(), fields.end(), [&](std::string_view field) {
    return parse(field, separator).has_value();
  });
  if (found == fields.end()) return std::nullopt;
  return static_cast<std::size_t>(found - fields.begin());
}

// Whether two lines look like rows of one table: numbers in the same columns, two or more.
bool are_rows(std::string_view line, std::string_view next, char separator) {
  const auto a = split(line, separator), b = split(next, separator);
  if (a.size() != b.size()) return false;
  int numbers = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool is_number = parse(a[i], separator).has_value();
    if (is_number != parse(b[i], separator).has_value()) return false;
    numbers += is_number ? 1 : 0;
  }
  return numbers >= 2;
}

class RecordReader {
 public:
  RecordReader(const std::string& file, std::string_view text)
      : text_(text),
        lines_(file, text),
        remedy_("; sprag import_events " + file +
                " --record NAME --output RECORD.csv converts other forms of tables") {}

  Record read(const RecordColumns& columns);

 private:
  static constexpr std::string_view comments = "#%";

  bool has_header() const { return !head_.empty(); }
  [[noreturn]] void fail_at_names(const std::string& message) const {
    (has_header() ? head_[head_.size() - (units_.empty() ? 1 : 2)] : lines_).fail(message);
  }
  void refuse_binary() const;
  void find_rows();
  void read_names();
  void split_row();
  std::size_t column_of(const std::string& name, const char* key) const;
  void choose_columns(const RecordColumns& columns);
  double per_second_of_times();
  double number(std::size_t column);
  void check_gaps(const Record& record) const;

  std::string_view text_;
  TextLines lines_;
  std::string remedy_;           ///< for a file that is not in the form of a record
  std::vector<TextLines> head_;  ///< at the lines above the rows
  char separator_ = ',';
  char mark_ = 0;  // decimal point or comma, once a number has one
  std::vector<std::string_view> fields_;
  std::vector<std::string> names_, units_;  ///< units by a row of units; empty: there is none
  std::size_t time_ = 0, signal_ = 1;
  std::vector<int> numbers_;  // of the samples' lines
  std::vector<std::string> remarks_;
};

// Moves to the first row, and keeps the lines above it. A line above two rows that has a number
// where they have their first one is a row, too, so that none is lost for an odd cell.
void RecordReader::find_rows() {
  std::vector<TextLines> seen;
  bool found = false;
  while (!found && seen.size() < longest_head && lines_.next_data(comments)) {
    seen.push_back(lines_);
    if (seen.size() < 2) continue;
    const std::string_view last = seen[seen.size() - 2].line();
    separator_ = separator_of(last);
    found = are_rows(last, lines_.line(), separator_);
  }
  if (seen.empty()) lines_.fail_whole("has no samples");
  std::size_t begin = found ? seen.size() - 2 : std::min<std::size_t>(1, seen.size() - 1);
  if (!found) separator_ = separator_of(seen.front().line());
  const auto column = first_number(seen[begin].line(), separator_);
  while (begin > 0 && column && first_number(seen[begin - 1].line(), separator_) == column) --begin;
  lines_ = seen[begin];
  seen.resize(begin, lines_);
  head_ = std::move(seen);
}

// The names above the rows, which may have units between them.
void RecordReader::read_names() {
  const auto cells = [&](const TextLines& line) {
    std::vector<std::string> result;
    for (const std::string_view field : split(line.line(), separator_)) {
      result.emplace_back(trimmed(field, blanks_and_quotes));
    }
    return result;
  };
  names_ = cells(has_header() ? head_.back() : lines_);
  std::size_t used = has_header() ? 1 : 0;
  if (head_.size() > 1) {
    std::vector<std::string> units;
    for (const std::string& name : names_) {
      if (const auto unit = unit_of_cell(name)) units.push_back(*unit);
    }
    std::vector<std::string> above = cells(head_[head_.size() - 2]);
    if (units.size() == names_.size() && above.size() == names_.size()) {
      used = 2;
      names_ = std::move(above);
      units_ = std::move(units);
    }
  }
  if (head_.size() > used) {
    remarks_.push_back("is read from line " + std::to_string(head_[head_.size() - used].number()) +
                       " on");
  }
}

void RecordReader::split_row() {
  fields_ = split(lines_.line(), separator_);
  if (fields_.size() == names_.size()) return;
  lines_.fail("the row has " + std::to_string(fields_.size()) + " fields; must have " +
              std::to_string(names_.size()) + ", as the " +
              (has_header() ? "header" : "first row") + remedy_);
}

std::size_t RecordReader::column_of(const std::string& name, const char* key) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end()) return static_cast<std::size_t>(found - names_.begin());
  std::string list;
  for (const std::string& one : names_) list += (list.empty() ? "'" : ", '") + one + "'";
  fail_at_names("has no column '" + name + "' (key " + key + "); must be one of " +
                (has_header() ? list : "the names in a header line, which the file does not have") +
                remedy_);
}

void RecordReader::choose_columns(const RecordColumns& columns) {
  const std::size_t count = names_.size();
  if (!columns.time.empty()) time_ = column_of(columns.time, "time");
  if (!columns.signal.empty()) {
    signal_ = column_of(columns.signal, "of the signal");
  } else if (count == 2) {
    signal_ = 1 - time_;
  } else {
    fail_at_names(
        "has " + std::to_string(count) +
        (count == 1
             ? " column; must have a time and a signal, separated by ',', ';', tab or blanks" +
                   remedy_
             : " columns; the scene must name the signal's column, as in "
               "acceleration = \"" +
                   names_[std::min<std::size_t>(1, count - 1)] + "\""));
  }
  if (signal_ == time_) {
    fail_at_names("the column '" + names_[time_] + "' is the time; the signal must be another");
  }
}

// How many of the column's units of time are one second.
double RecordReader::per_second_of_times() {
  std::string unit = has_header() ? unit_in(names_[time_]) : "";
  if (unit.empty() && !units_.empty()) unit = units_[time_];
  const double count = per_second(unit).value_or(1.0);
  if (count == 0.0) {
    fail_at_names("the column '" + names_[time_] + "' has times in " + unit +
                  "; must be in s, ms, us or ns" + remedy_);
  }
  if (count != 1.0) {
    remarks_.push_back("has times in " + unit + ", as column '" + names_[time_] + "' says");
  }
  return count;
}

// A number with the same decimal mark as those before.
double RecordReader::number(std::size_t column) {
  const std::string_view field = fields_[column];
  const std::size_t at = separator_ == ',' ? std::string_view::npos : field.find_first_of(".,");
  const char own = at == std::string_view::npos ? mark_ : field[at];
  const auto value = parse(field, separator_);
  if (value && (mark_ == 0 || own == mark_)) {
    mark_ = own;
    return *value;
  }
  if (field.find_first_not_of(" \t") == std::string_view::npos) {
    lines_.fail(field,
                "a field is empty; must be a number (a gap in the record cannot be interpolated)");
  }
  const std::string shown(field.substr(0, 30));
  lines_.fail(field,
              "'" + shown + "' is not a finite number; must be one, as 0.25 or 1e-3" + remedy_);
}

void RecordReader::check_gaps(const Record& record) const {
  std::vector<double> intervals;
  for (std::size_t k = 1; k < record.t.size(); ++k) {
    intervals.push_back(record.t[k] - record.t[k - 1]);
  }
  std::vector<double> sorted = intervals;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double usual = sorted[sorted.size() / 2];
  const auto regular = std::count_if(intervals.begin(), intervals.end(), [&](double h) {
    return std::abs(h - usual) <= alike * usual;
  });
  if (static_cast<double>(regular) < share_of_alike * static_cast<double>(intervals.size())) return;
  for (std::size_t k = 0; k < intervals.size(); ++k) {
    if (intervals[k] <= gap_factor * usual) continue;
    lines_.fail_at(numbers_[k + 1], "there is a gap of " + rounded(intervals[k]) +
                                        " s after t = " + to_text(record.t[k]) +
                                        ", where samples are " + rounded(usual) +
                                        " s apart; the record must have no gaps (cut it there)");
  }
}

void RecordReader::refuse_binary() const {
  for (const auto& [begin, kind] : kinds) {
    if (text_.starts_with(begin)) lines_.fail_whole(std::string("is ") + kind + remedy_);
  }
  const std::string_view head = text_.substr(0, looked_at);
  if (std::any_of(head.begin(), head.end(), [](char c) { return c >= 0 && c < '\t'; })) {
    lines_.fail_whole("is a binary file; must be a text. Export CSV");
  }
}

Record RecordReader::read(const RecordColumns& columns) {
  refuse_binary();
  find_rows();
  read_names();
  split_row();
  choose_columns(columns);
  const double per_second = per_second_of_times();
  Record record;
  if (has_header()) record.column = names_[signal_];
  if (!units_.empty()) record.column += " [" + units_[signal_] + "]";
  for (bool more = true; more; more = lines_.next_data(comments)) {
    split_row();
    const double t = number(time_) / per_second;
    const double value = number(signal_);
    if (!record.t.empty() && !(t > record.t.back())) {
      lines_.fail(fields_[time_], "the time " + to_text(t) +
                                      (t == record.t.back() ? " repeats" : " is before") +
                                      " that of the row before, " + to_text(record.t.back()) +
                                      "; times must increase");
    }
    record.t.push_back(t);
    record.values.push_back(value);
    numbers_.push_back(lines_.number());
  }
  if (record.t.size() < fewest_samples) {
    lines_.fail_whole("has " + std::to_string(record.t.size()) + " samples; must have at least " +
                      std::to_string(fewest_samples));
  }
  check_gaps(record);
  if (mark_ == ',') remarks_.emplace_back("is read with decimal commas");
  record.remarks = std::move(remarks_);
  return record;
}

}  // namespace

Record read_record_file(const std::filesystem::path& file, const RecordColumns& columns) {
  const std::string text = read_regular_text(file);
  return RecordReader(file.string(), text).read(columns);
}

}  // namespace sprag
