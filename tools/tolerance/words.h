// Common parts of tables of medians: short numbers, deviations in words, aligned columns.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "sprag/detail/tolerance/search.h"

namespace sprag::tolerance {

/// The number with two digits.
std::string short_number(double value);

/// "0.3 ms", "5 %", "0.02 rad", "0.1 per s and contact".
std::string amount_text(const Deviation& of, double amount);

/// "event times to 0.3 ms", "2 % of the events lost", "impact.restitution to 5 %".
std::string in_words(const Deviation& of, double amount);

/// Appends a line of cells, with minimum widths of the first and of the others.
void add_line(const std::vector<std::string>& cells, std::size_t first, std::size_t other,
              std::string& text);

/// Median, low and high; null for infinite values and NaN, which JSON does not have.
nlohmann::ordered_json to_json(const Spread& spread);

/// ",median,low,high", with 17 digits.
void append_spread(const Spread& spread, std::string& text);

}  // namespace sprag::tolerance
