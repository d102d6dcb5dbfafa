#include "tools/listen/clock_time.h"

#include <chrono>
#include <cstdint>
#include <regex>
#include <string>

namespace sprag {

namespace {

constexpr int day = 86400;

// Adds whole seconds to a number of seconds below 61, exactly.
Decimal plus(Decimal seconds, std::int64_t whole) {
  if (seconds.mantissa == 0) seconds.exponent = 0;
  Decimal::Integer unit = 1;
  for (int e = seconds.exponent; e < 0; ++e) unit *= 10;
  for (; seconds.exponent > 0; --seconds.exponent) seconds.mantissa *= 10;
  seconds.mantissa += whole * unit;
  return seconds;
}

}  // namespace

std::optional<ClockTime> parse_clock_time(std::string_view text, DecimalMark mark) {
  using enum ClockTime::Kind;
  namespace chrono = std::chrono;
  if (const auto value = parse_decimal(text, mark)) return ClockTime{*value, number};
  // 1 year, 2 separator, 3 month, 4 day; 5 hours, 6 minutes, 7 seconds; 8 time zone with 9 sign,
  // 10 hours, 11 minutes.
  static const std::regex pattern(
      R"((?:(\d{4})([-/])(\d\d)\2(\d\d)[T ])?(\d\d?):(\d\d):(\d\d(?:[.,]\d{0,18})?))"
      R"(( ?(?:Z|([-+])(\d\d):?(\d\d)?)?))");
  std::cmatch part;
  if (!std::regex_match(text.data(), text.data() + text.size(), part, pattern)) return std::nullopt;
  const auto whole = [&](std::size_t i) { return part[i].matched ? std::stoi(part[i]) : 0; };
  const auto seconds = parse_decimal(part[7].str(), DecimalMark::point_or_comma);
  if (!seconds || whole(5) > 24 || whole(6) > 59 || whole(7) > 60) return std::nullopt;
  const Decimal time = plus(*seconds, 3600 * whole(5) + 60 * whole(6));
  if (!part[1].matched) {
    return part[8].length() > 0 ? std::nullopt : std::optional(ClockTime{time, time_of_day});
  }
  const chrono::year_month_day at(chrono::year(whole(1)),
                                  chrono::month(static_cast<unsigned>(whole(3))),
                                  chrono::day(static_cast<unsigned>(whole(4))));
  if (!at.ok()) return std::nullopt;
  const int zone = (part[9] == "-" ? -1 : 1) * (3600 * whole(10) + 60 * whole(11));
  const std::int64_t days = chrono::sys_days(at).time_since_epoch().count();
  return ClockTime{plus(time, days * day - zone), date};
}

Decimal after_midnight(const Decimal& time_of_day, const Decimal& last) {
  const Decimal second{1, 0};
  Decimal time = time_of_day;
  while (difference_in(last, time, second) > day / 2) time = plus(time, day);
  return time;
}

}  // namespace sprag
