// Reads the lines of a source of edges: a time, and the levels of one or more contacts. Knows
// neither a clock nor what an edge is.
//
// A line has one contact, in the columns `time`, `contact` and `level`, or a column of levels for
// each contact (--level). A header line or --columns names the columns; without both they are
// time,contact,level. Without a level a line is an impact. Fields are separated by tabs,
// semicolons, commas or blanks. The output of gpiomon (libgpiod 1 and 2) is read as it is; --level
// names its GPIO lines. Lines that begin with # or ; are comments. A row of units may follow the
// header. A further column may have samples of an input (--input); a line without a number there
// has no sample.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/listen/clock_time.h"
#include "tools/listen/unit.h"

namespace sprag {

struct LineOptions {
  int contacts = 1;                 ///< of the scene
  std::optional<char> separator;    ///< none: found in every line
  std::vector<std::string> names;   ///< of the columns (--columns); empty: as the header says
  std::vector<std::string> levels;  ///< columns of levels, each NAME or CONTACT=NAME, all alike;
                                    ///< empty: a line has one contact
  std::string time;                 ///< column of times; empty: the one that begins with Time
  std::string input;                ///< column of samples of an input; empty: none
  std::optional<double> threshold;  ///< none: levels are 0 and 1
  bool needs_time = true;           ///< lines without a time cannot be used
};

/// A column of levels, or a GPIO line.
struct LevelColumn {
  std::string name;
  int contact = 0;  ///< from 0
};

/// The level of one contact.
struct ContactLevel {
  int contact = 0;              ///< from 0
  std::optional<double> level;  ///< none: the line is an impact
  bool edge = false;            ///< the level has changed to this one at the time of the line
};

struct ParsedLine {
  enum class Kind { nothing, header, units, levels, problem };

  Kind kind = Kind::nothing;
  std::optional<ClockTime> time;
  std::vector<ContactLevel> levels;
  std::optional<double> sample;  ///< of the input, in the unit of its column
  std::string problem;           ///< why the line cannot be used
};

class LineParser {
 public:
  /// Throws UsageError if --level or --columns do not fit each other or the scene.
  explicit LineParser(const LineOptions& options);

  /// Reads a line without its end. A header sets the columns, and may be repeated.
  ParsedLine parse(std::string_view line);

  /// Whether every line has the levels of all its contacts, so that the first line is their state
  /// at the start and not an edge.
  bool has_all_levels() const { return !levels_.empty(); }

  /// The unit of times that the row of units or else the name of their column states.
  std::optional<NamedUnit> time_unit() const;

 private:
  struct Roles {
    std::optional<std::size_t> time, contact, level, input;
    std::vector<std::pair<std::size_t, int>> levels;  // column, contact
  };

  bool read_gpiomon(std::string_view line, ParsedLine& result) const;
  bool split(std::string_view line, std::size_t wanted);
  bool is_header() const;
  DecimalMark mark() const {
    return separator_ == ',' ? DecimalMark::point : DecimalMark::point_or_comma;
  }
  bool read_units();
  std::string assign(const std::vector<std::string>& names);
  std::string read_sample(std::string_view text, ParsedLine& result) const;
  std::string read_level(std::string_view text, int contact, ParsedLine& result) const;

  LineOptions options_;
  std::vector<LevelColumn> levels_;
  std::vector<std::string> names_;  // empty: not known
  Roles roles_;
  bool headed_ = false;                // a header has named the columns
  bool begun_ = false;                 // a line with a time has followed the header, or the start
  std::optional<NamedUnit> row_unit_;  // of times, in a row of units
  char separator_ = ',';               // of the last line
  std::vector<std::string_view> fields_;
};

}  // namespace sprag
