#include "tools/listen/clock_time.h"

#include <charconv>
#include <chrono>
#include <cstdint>

namespace sprag {

namespace {

constexpr int day = 86400;

bool decimal_digit(char c) { return c >= '0' && c <= '9'; }

// Reads a number of exactly `digits` digits.
std::optional<int> take_number(std::string_view& text, std::size_t digits) {
  if (text.size() < digits) return std::nullopt;
  int value = 0;
  for (const char c : text.substr(0, digits)) {
    if (!decimal_digit(c)) return std::nullopt;
    value = 10 * value + (c - '0');
  }
  text.remove_prefix(digits);
  return value;
}

bool take(char c, std::string_view& text) {
  if (!text.starts_with(c)) return false;
  text.remove_prefix(1);
  return true;
}

// Adds whole seconds to a number of seconds below 61, exactly.
Decimal plus(Decimal seconds, std::int64_t whole) {
  if (seconds.mantissa == 0) seconds.exponent = 0;
  Decimal::Integer unit = 1;
  for (int e = seconds.exponent; e < 0; ++e) unit *= 10;
  for (; seconds.exponent > 0; --seconds.exponent) seconds.mantissa *= 10;
  seconds.mantissa += whole * unit;
  return seconds;
}

// Reads "12:34:56.789" from the front of the text.
std::optional<Decimal> take_time(std::string_view& text) {
  const std::size_t hour_digits = text.size() > 1 && text[1] == ':' ? 1 : 2;
  const auto hours = take_number(text, hour_digits);
  if (!hours || *hours > 24 || !take(':', text)) return std::nullopt;
  const auto minutes = take_number(text, 2);
  if (!minutes || *minutes > 59 || !take(':', text)) return std::nullopt;
  constexpr std::size_t longest = 2 + 1 + 18;
  std::size_t size = 0;
  while (size < text.size() && size < longest &&
         (decimal_digit(text[size]) || (size == 2 && (text[size] == '.' || text[size] == ',')))) {
    ++size;
  }
  if (size < 2 || (size > 2 && decimal_digit(text[2]))) return std::nullopt;
  const auto seconds = parse_decimal(text.substr(0, size), DecimalMark::point_or_comma);
  const int whole = 10 * (text[0] - '0') + (text[1] - '0');
  if (!seconds || whole > 60) return std::nullopt;
  text.remove_prefix(size);
  return plus(*seconds, 3600 * *hours + 60 * *minutes);
}

// Reads "Z", "+02:00", "-0530" or nothing; returns the seconds ahead of UTC.
std::optional<int> take_zone(std::string_view& text) {
  if (take('Z', text) || text.empty()) return 0;
  const int sign = text.starts_with('-') ? -1 : 1;
  if (!take('+', text) && !take('-', text)) return std::nullopt;
  const auto hours = take_number(text, 2);
  take(':', text);
  const auto minutes = text.empty() ? std::optional(0) : take_number(text, 2);
  if (!hours || !minutes) return std::nullopt;
  return sign * (3600 * *hours + 60 * *minutes);
}

std::optional<Decimal> parse_date(std::string_view text) {
  namespace chrono = std::chrono;
  const auto year = take_number(text, 4);
  const char between = text.starts_with('/') ? '/' : '-';
  if (!year || !take(between, text)) return std::nullopt;
  const auto month = take_number(text, 2);
  if (!month || !take(between, text)) return std::nullopt;
  const auto of_month = take_number(text, 2);
  if (!of_month || (!take('T', text) && !take(' ', text))) return std::nullopt;
  const chrono::year_month_day date(chrono::year(*year),
                                    chrono::month(static_cast<unsigned>(*month)),
                                    chrono::day(static_cast<unsigned>(*of_month)));
  if (!date.ok()) return std::nullopt;
  const auto time = take_time(text);
  if (!time) return std::nullopt;
  if (text.starts_with(' ')) text.remove_prefix(1);
  const auto zone = take_zone(text);
  if (!zone || !text.empty()) return std::nullopt;
  const std::int64_t days = chrono::sys_days(date).time_since_epoch().count();
  return plus(*time, days * day - *zone);
}

}  // namespace

std::optional<ClockTime> parse_clock_time(std::string_view text, DecimalMark mark) {
  using enum ClockTime::Kind;
  if (const auto value = parse_decimal(text, mark)) return ClockTime{*value, number};
  if (const auto value = parse_date(text)) return ClockTime{*value, date};
  if (const auto value = take_time(text); value && text.empty()) {
    return ClockTime{*value, time_of_day};
  }
  return std::nullopt;
}

Decimal after_midnight(const Decimal& time_of_day, const Decimal& last) {
  const Decimal second{1, 0};
  Decimal time = time_of_day;
  while (difference_in(last, time, second) > day / 2) time = plus(time, day);
  return time;
}

}  // namespace sprag
