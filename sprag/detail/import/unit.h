// The unit of a file's times: specified, or part of the columns' names.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/import/column_file.h"
#include "sprag/detail/import/decimal.h"
#include "sprag/detail/import/import.h"

namespace sprag {

/// "s", "ms", "us", "ns" or a finite number > 0, in seconds; nullopt for any other text.
std::optional<Decimal> parse_unit(std::string_view text);

/// A unit of time that a column's name ends with or has in brackets: "Impact [ms]", "on (s)",
/// "Zeit / us", "t in µs", "off_ns".
struct NamedUnit {
  std::string text;
  std::optional<Decimal> seconds;  ///< none: a unit that --unit does not support, such as minutes
};

/// Nullopt if the name contains no unit.
std::optional<NamedUnit> unit_in(std::string_view column);

struct ChosenUnit {
  Decimal seconds{1, 0};
  std::string
      remark;  ///< message for the user: source of the unit, or a contradiction; may be empty
};

/// `given` if it is specified; else the unit in the names of the chosen columns; else seconds.
/// Throws InputError if no unit is specified and the names disagree or
/// contain an unsupported unit.
ChosenUnit choose_unit(const std::optional<Decimal>& given, const ColumnFile& columns,
                       const std::vector<ContactColumns>& chosen, const std::string& file);

}  // namespace sprag
