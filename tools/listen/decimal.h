// Exact decimal numbers. A clock's count of nanoseconds since 1970 does not fit a double; the
// difference of two such counts does.
#pragma once

#include <optional>
#include <string_view>

namespace sprag {

/// mantissa * 10^exponent, |mantissa| < 10^36.
struct Decimal {
  __extension__ typedef __int128 Integer;
  Integer mantissa = 0;
  int exponent = 0;
};

/// The character between a number's whole part and its fraction.
enum class DecimalMark { point, point_or_comma };

/// "-12", "+1.5", ".5", "2.5E-3". Nullopt for any other text, and for numbers beyond 10^336. Digits
/// after the 36th are dropped.
std::optional<Decimal> parse_decimal(std::string_view text, DecimalMark mark = DecimalMark::point);

/// (value - offset) * unit, rounded once, to the nearest double. If 38 digits cannot hold the
/// difference or the product, the terms are rounded to long double first. May be infinite.
double difference_in(const Decimal& value, const Decimal& offset, const Decimal& unit);

}  // namespace sprag
