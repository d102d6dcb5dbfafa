#include "tools/listen/decimal.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

namespace sprag {

namespace {

using Integer = Decimal::Integer;

constexpr int most_digits = 36;  // fewer than 128 bits hold, which leaves room for a carry
constexpr int largest_power = 300;
constexpr std::size_t longest_text = 1000;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// number * 10^power; nullopt on overflow.
std::optional<Integer> scaled(Integer number, int power) {
  for (; power > 0 && number != 0; --power) {
    if (__builtin_mul_overflow(number, 10, &number)) return std::nullopt;
  }
  return number;
}

std::optional<Decimal> difference(const Decimal& a, const Decimal& b) {
  if (b.mantissa == 0) return a;
  if (a.mantissa == 0) return Decimal{-b.mantissa, b.exponent};
  const int exponent = std::min(a.exponent, b.exponent);
  const auto left = scaled(a.mantissa, a.exponent - exponent);
  const auto right = scaled(b.mantissa, b.exponent - exponent);
  Decimal result{0, exponent};
  if (!left || !right || __builtin_sub_overflow(*left, *right, &result.mantissa))
    return std::nullopt;
  return result;
}

std::optional<Decimal> product(const Decimal& a, const Decimal& b) {
  Decimal result{0, a.exponent + b.exponent};
  if (__builtin_mul_overflow(a.mantissa, b.mantissa, &result.mantissa)) return std::nullopt;
  return result;
}

double nearest_double(const Decimal& number) {
  std::array<char, 64> text;
  char* const end = text.data() + text.size();
  char* digit = end - 8;  // the exponent is written after the digits
  const char* const exponent_end = std::to_chars(digit + 1, end, number.exponent).ptr;
  *digit = 'e';
  const bool negative = number.mantissa < 0;
  Integer rest = number.mantissa;
  do {
    const int last = static_cast<int>(rest % 10);
    *--digit = static_cast<char>('0' + (negative ? -last : last));
    rest /= 10;
  } while (rest != 0);
  if (negative) *--digit = '-';
  double value = 0.0;
  if (std::from_chars(digit, exponent_end, value).ec != std::errc::result_out_of_range)
    return value;
  // from_chars does not distinguish overflow from underflow.
  return number.exponent > 0 ? std::numeric_limits<double>::infinity() : 0.0;
}

long double approximate(const Decimal& number) {
  return static_cast<long double>(number.mantissa) *
         std::pow(10.0L, static_cast<long double>(number.exponent));
}

}  // namespace

std::optional<Decimal> parse_decimal(std::string_view text, DecimalMark mark) {
  if (text.size() > longest_text) return std::nullopt;
  const bool negative = text.starts_with('-');
  if (negative || text.starts_with('+')) text.remove_prefix(1);
  Decimal number;
  int kept = 0;
  int exponent = 0;
  bool digits = false;
  bool fraction = false;
  for (; !text.empty(); text.remove_prefix(1)) {
    const char c = text.front();
    if (is_digit(c)) {
      digits = true;
      if (kept < most_digits) {
        number.mantissa = 10 * number.mantissa + (c - '0');
        if (number.mantissa != 0) ++kept;
        if (fraction) --exponent;
      } else if (!fraction) {
        ++exponent;
      }
    } else if (!fraction && (c == '.' || (c == ',' && mark == DecimalMark::point_or_comma))) {
      fraction = true;
    } else {
      break;
    }
  }
  if (!digits) return std::nullopt;
  if (text.starts_with('e') || text.starts_with('E')) {
    text.remove_prefix(1);
    if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
    int power = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), power);
    if (error != std::errc{} || std::abs(power) > 10'000) return std::nullopt;
    exponent += power;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
  if (!text.empty()) return std::nullopt;
  if (number.mantissa == 0) return Decimal{};
  for (; number.mantissa % 10 == 0; ++exponent) number.mantissa /= 10;
  if (exponent > largest_power) return std::nullopt;
  if (exponent < -largest_power - most_digits) return Decimal{};
  if (negative) number.mantissa = -number.mantissa;
  number.exponent = exponent;
  return number;
}

double difference_in(const Decimal& value, const Decimal& offset, const Decimal& unit) {
  const auto elapsed = difference(value, offset);
  const auto exact = elapsed ? product(*elapsed, unit) : std::nullopt;
  if (exact) return nearest_double(*exact);
  const long double span =
      elapsed ? approximate(*elapsed) : approximate(value) - approximate(offset);
  return static_cast<double>(span * approximate(unit));
}

}  // namespace sprag
