#include "tools/listen/unit.h"

#include <algorithm>
#include <array>
#include <utility>

#include "sprag/detail/files/csv.h"

namespace sprag {

namespace {

/// Names of a power of ten of the second; the first one is that of --unit.
struct Names {
  int exponent;
  std::array<std::string_view, 6> names;
};

constexpr Names units[] = {
    {0, {"s", "sec", "second", "seconds"}},
    {-3, {"ms", "msec", "millisecond", "milliseconds"}},
    // With a micro sign, and with mu.
    {-6, {"us", "usec", "microsecond", "microseconds", "\xC2\xB5s", "\xCE\xBCs"}},
    {-9, {"ns", "nsec", "nanosecond", "nanoseconds"}}};

constexpr std::string_view without_a_name[] = {"min",  "minutes", "h",      "hours",   "d",
                                               "days", "ticks",   "counts", "samples", "cycles"};

std::optional<NamedUnit> as_unit(std::string_view text) {
  text = trimmed(text);
  if (text.empty()) return std::nullopt;
  for (const auto& [exponent, names] : units) {
    if (std::ranges::find(names, text) != names.end())
      return NamedUnit{std::string(text), Decimal{1, exponent}};
  }
  if (std::ranges::find(without_a_name, text) != std::ranges::end(without_a_name))
    return NamedUnit{std::string(text), std::nullopt};
  return std::nullopt;
}

}  // namespace

std::optional<Decimal> parse_unit(std::string_view text) {
  for (const auto& [exponent, names] : units) {
    if (text == names[0]) return Decimal{1, exponent};
  }
  const auto number = parse_decimal(text);
  return number && number->mantissa > 0 ? number : std::nullopt;
}

std::optional<NamedUnit> unit_in(std::string_view column) {
  for (const auto& [open, close] : {std::pair('[', ']'), std::pair('(', ')')}) {
    for (std::size_t begin = column.find(open); begin != std::string_view::npos;
         begin = column.find(open, begin + 1)) {
      const std::size_t end = column.find(close, begin);
      if (end == std::string_view::npos) break;
      if (auto unit = as_unit(column.substr(begin + 1, end - begin - 1))) return unit;
    }
  }
  for (const std::string_view before : {" in ", "/", "_"}) {
    const std::size_t place = column.rfind(before);
    if (place == std::string_view::npos) continue;
    if (auto unit = as_unit(column.substr(place + before.size()))) return unit;
  }
  return std::nullopt;
}

std::optional<NamedUnit> unit_of_cell(std::string_view cell) {
  cell = trimmed(cell);
  const bool in_brackets = (cell.starts_with('(') && cell.ends_with(')')) ||
                           (cell.starts_with('[') && cell.ends_with(']'));
  if (!in_brackets) return as_unit(cell);
  const std::string_view inner = trimmed(cell.substr(1, cell.size() - 2));
  return as_unit(inner).value_or(NamedUnit{std::string(inner), std::nullopt});
}

}  // namespace sprag
