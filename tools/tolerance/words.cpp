#include "tools/tolerance/words.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "sprag/detail/files/csv.h"

namespace sprag::tolerance {
namespace {

using Kind = Deviation::Kind;

void append_padded(const std::string& cell, std::size_t width, std::string& line) {
  line += cell;
  if (cell.size() < width) line.append(width - cell.size(), ' ');
}

// JSON has no infinity.
nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

std::string time_text(double seconds) {
  if (seconds >= 0.1) return short_number(seconds) + " s";
  if (seconds >= 1e-4) return short_number(1e3 * seconds) + " ms";
  return short_number(1e6 * seconds) + " us";
}

}  // namespace

std::string short_number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2g", value);
  return text.data();
}

std::string amount_text(const Deviation& of, double amount) {
  switch (of.kind) {
    case Kind::jitter:
    case Kind::offset:
      return time_text(amount);
    case Kind::spurious:
      return short_number(amount) + " per s and contact";
    case Kind::lost:
    case Kind::parameter:
      break;
  }
  if (of.share) return short_number(100.0 * amount) + " %";
  return short_number(amount) + (of.unit.empty() ? "" : " " + of.unit);
}

std::string in_words(const Deviation& of, double amount) {
  const std::string text = amount_text(of, amount);
  switch (of.kind) {
    case Kind::jitter:
      return "event times to " + text;
    case Kind::offset:
      return "clocks to " + text;
    case Kind::lost:
      return text + " of the events lost";
    case Kind::spurious:
      return short_number(amount) + " false pulses per s and contact";
    case Kind::parameter:
      break;
  }
  return of.name + " to " + text;
}

void add_line(const std::vector<std::string>& cells, std::size_t first, std::size_t other,
              std::string& text) {
  std::string line;
  append_padded(cells.front(), first, line);
  for (std::size_t i = 1; i < cells.size(); ++i) {
    line += "  ";
    append_padded(cells[i], other, line);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  text += line;
  text += '\n';
}

nlohmann::ordered_json to_json(const Spread& spread) {
  return {{"median", number_or_null(spread.median)},
          {"low", number_or_null(spread.low)},
          {"high", number_or_null(spread.high)}};
}

void append_spread(const Spread& spread, std::string& text) {
  for (const double value : {spread.median, spread.low, spread.high}) {
    text += ',';
    append_number(text, value);
  }
}

}  // namespace sprag::tolerance
