// Times in the formats of clocks and loggers: numbers, dates with a time (ISO 8601), times of day.
#pragma once

#include <optional>
#include <string_view>

#include "tools/listen/decimal.h"

namespace sprag {

struct ClockTime {
  Decimal value;
  enum class Kind {
    number,      ///< in the file's unit
    date,        ///< seconds since 1970, UTC without a time zone
    time_of_day  ///< seconds since midnight
  } kind = Kind::number;
};

/// "12.5"; "2026-05-01T12:34:56.789Z", "2026-05-01 12:34:56+02:00"; "12:34:56.789". Seconds may
/// have any number of digits after a point or a comma. Nullopt for any other text.
std::optional<ClockTime> parse_clock_time(std::string_view text, DecimalMark mark);

/// Moves a time of day by whole days if it is more than half a day before `last`, since it then
/// belongs to a later day.
Decimal after_midnight(const Decimal& time_of_day, const Decimal& last);

}  // namespace sprag
