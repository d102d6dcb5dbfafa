// The unit of a file's times: as it is told, or as the columns' names say it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/import_events/choice.h"
#include "tools/import_events/column_file.h"
#include "tools/import_events/decimal.h"

namespace sprag {

/// "s", "ms", "us", "ns" or a finite number > 0, in seconds; nothing for anything else.
std::optional<Decimal> parse_unit(std::string_view text);

/// A unit of time that a column's name ends with or has in brackets: "Impact [ms]", "on (s)",
/// "Zeit / us", "t in µs", "off_ns".
struct NamedUnit {
  std::string text;
  std::optional<Decimal> seconds;  ///< none: a unit that --unit has no name for, like minutes
};

/// Nothing if the name says no unit.
std::optional<NamedUnit> unit_in(std::string_view column);

struct ChosenUnit {
  Decimal seconds{1, 0};
  std::string remark;  ///< for people: where it comes from, or what contradicts it; may be empty
};

/// `given` if it is there; else what the names of the chosen columns say; else seconds. Throws
/// UsageError (command_line/program.h) if nothing is given and the names disagree or say a unit
/// that is not known.
ChosenUnit choose_unit(const std::optional<Decimal>& given, const ColumnFile& columns,
                       const std::vector<ContactColumns>& chosen, const std::string& file);

}  // namespace sprag
