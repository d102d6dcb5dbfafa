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
// Units of time other than s, in lower case.
constexpr std::string_view other_units =
    " ms msec millisecond milliseconds us usec \u00B5s \u03BCs microsecond microseconds ns nsec "
    "nanosecond nanoseconds ps fs min minutes h hours d days ticks counts samples cycles frames ";
// First bytes of files that import_events converts.
constexpr std::array<std::pair<std::string_view, const char*>, 6> kinds{
    {{"\x93NUMPY", "a numpy array"},
     {"MATLAB 5.0", "a MATLAB file"},
     {"PK\x03\x04", "an Excel file or a zip archive"},
     {"RIFF", "a sound"},
     {"\xFF\xFE", "a text in UTF-16"},
     {"\xFE\xFF", "a text in UTF-16"}}};
constexpr std::size_t looked_at = 4000;  // bytes

std::string_view without_blanks_or_quotes(std::string_view field) {
  const auto first = field.find_first_not_of(" \t\"'");
  if (first == std::string_view::npos) return {};
  return field.substr(first, field.find_last_not_of(" \t\"'") - first + 1);
}

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

// The unit other than s in the name of a column of times: "Time [ms]", "t (us)", "t / ns", "t_ms",
// "t in ms", "microseconds"; empty: none.
std::string unit_in(const std::string& name) {
  std::size_t begin = name.find_last_of("[(/_");
  if (begin == std::string::npos) begin = name.rfind(" in ");
  if (begin == std::string::npos && name.size() <= 2) return {};
  begin = begin == std::string::npos ? 0 : name[begin] == ' ' ? begin + 4 : begin + 1;
  const std::string_view rest(name.data() + begin, name.size() - begin);
  const std::string unit(without_blanks_or_quotes(rest.substr(0, rest.find_first_of("])"))));
  std::string lower = " " + unit + " ";
  for (char& c : lower) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return other_units.find(lower) != std::string_view::npos ? unit : std::string();
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
  bool next() { return lines_.next_data("#%"); }
  void split();
  std::size_t column_of(const std::string& name, const char* key) const;
  void choose_columns(const RecordColumns& columns);
  std::optional<double> parse(std::string_view field);
  double number(std::size_t column);
  void check_gaps(const Record& record) const;

  void refuse_binary() const;

  std::string_view text_;
  TextLines lines_;
  std::string remedy_;  ///< for a file that is not in the form of a record
  char separator_ = ',';
  char mark_ = 0;  // decimal point or comma, once a number has one
  bool header_ = false;
  std::vector<std::string_view> fields_;
  std::vector<std::string> names_;
  std::size_t time_ = 0, signal_ = 1, count_ = 0;
  std::vector<int> numbers_;  // of the samples' lines
};

void RecordReader::split() {
  fields_.clear();
  std::string_view line = lines_.line();
  if (separator_ == ' ') {
    for (auto begin = line.find_first_not_of(' '); begin != std::string_view::npos;) {
      const std::size_t end = std::min(line.find(' ', begin), line.size());
      fields_.push_back(line.substr(begin, end - begin));
      begin = line.find_first_not_of(' ', end);
    }
    return;
  }
  while (true) {
    const std::size_t end = line.find(separator_);
    fields_.push_back(line.substr(0, end));
    if (end == std::string_view::npos) return;
    line.remove_prefix(end + 1);
  }
}

std::size_t RecordReader::column_of(const std::string& name, const char* key) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end()) return static_cast<std::size_t>(found - names_.begin());
  std::string list;
  for (const std::string& one : names_) list += (list.empty() ? "'" : ", '") + one + "'";
  lines_.fail("has no column '" + name + "' (key " + key + "); must be one of " +
              (header_ ? list : "the names in a header line, which the file does not have") +
              remedy_);
}

void RecordReader::choose_columns(const RecordColumns& columns) {
  count_ = fields_.size();
  for (const std::string_view field : fields_) {
    names_.emplace_back(without_blanks_or_quotes(field));
  }
  header_ = !parse(fields_.front()).has_value();
  if (!columns.time.empty()) time_ = column_of(columns.time, "time");
  if (const std::string unit = header_ ? unit_in(names_[time_]) : ""; !unit.empty()) {
    lines_.fail("the column '" + names_[time_] + "' has times in " + unit + "; must be in s" +
                remedy_);
  }
  if (!columns.signal.empty()) {
    signal_ = column_of(columns.signal, "of the signal");
  } else if (count_ == 2) {
    signal_ = 1 - time_;
  } else {
    lines_.fail(
        "has " + std::to_string(count_) +
        (count_ == 1
             ? " column; must have a time and a signal, separated by ',', ';', tab or blanks" +
                   remedy_
             : " columns; the scene must name the signal's column, as in "
               "acceleration = \"" +
                   names_[std::min<std::size_t>(1, count_ - 1)] + "\""));
  }
  if (signal_ == time_) {
    lines_.fail("the column '" + names_[time_] + "' is the time; the signal must be another");
  }
}

// A number with the same decimal mark as those before.
std::optional<double> RecordReader::parse(std::string_view field) {
  if (separator_ == ',') return parse_double(field);
  const std::size_t at = field.find_first_of(".,");
  if (at == std::string_view::npos) return parse_double(field);
  if (mark_ != 0 && field[at] != mark_) return std::nullopt;
  std::string with_point(field);
  with_point[at] = '.';
  const auto value = parse_double(with_point);
  if (value) mark_ = field[at];
  return value;
}

double RecordReader::number(std::size_t column) {
  const std::string_view field = fields_[column];
  if (const auto value = parse(field)) return *value;
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
  if (!next()) lines_.fail_whole("has no samples");
  separator_ = separator_of(lines_.line());
  split();
  choose_columns(columns);
  Record record;
  if (header_) record.column = names_[signal_];
  bool more = header_ ? next() : true;
  for (; more; more = next()) {
    split();
    if (fields_.size() != count_) {
      lines_.fail("the row has " + std::to_string(fields_.size()) + " fields; must have " +
                  std::to_string(count_) + ", as the first line" + remedy_);
    }
    const double t = number(time_);
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
  record.decimal_commas = mark_ == ',';
  return record;
}

}  // namespace

Record read_record_file(const std::filesystem::path& file, const RecordColumns& columns) {
  const std::string text = read_regular_text(file);
  return RecordReader(file.string(), text).read(columns);
}

}  // namespace sprag
