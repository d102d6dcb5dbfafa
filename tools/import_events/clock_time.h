// Times as clocks and loggers write them: numbers, dates with a time (ISO 8601), times of day.
#pragma once

#include <optional>
#include <string_view>

#include "tools/import_events/decimal.h"

namespace sprag {

struct ClockTime {
  Decimal value;
  enum class Kind {
    number,      ///< in the file's unit
    date,        ///< seconds since 1970, UTC where the zone is not said
    time_of_day  ///< seconds since midnight
  } kind = Kind::number;
};

/// "12.5"; "2026-05-01T12:34:56.789Z", "2026-05-01 12:34:56+02:00"; "12:34:56.789". Seconds may
/// have any number of digits behind a point or a comma. Nothing for anything else.
std::optional<ClockTime> parse_clock_time(std::string_view text, DecimalMark mark);

/// A time of day that is more than half a day before `last` belongs to a later day: the same, with
/// as many days added.
Decimal after_midnight(const Decimal& time_of_day, const Decimal& last);

}  // namespace sprag
