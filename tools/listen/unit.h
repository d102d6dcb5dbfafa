// The unit of times: specified, or part of a column's name.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "tools/listen/decimal.h"

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

/// The unit in a cell of a row of units: "ms", "(ms)", "[V]". Nullopt if the cell is no unit of
/// time and has no brackets.
std::optional<NamedUnit> unit_of_cell(std::string_view cell);

}  // namespace sprag
