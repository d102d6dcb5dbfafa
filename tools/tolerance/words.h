// What tables of medians have in common: short numbers, aligned columns.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tools/tolerance/search.h"

namespace sprag::tolerance {

/// With two digits.
std::string short_number(double value);

/// A line of cells, the first and the others at least so wide.
void add_line(const std::vector<std::string>& cells, std::size_t first, std::size_t other,
              std::string& text);

/// Median, low and high; null for what is not finite, which JSON cannot say.
nlohmann::ordered_json to_json(const Spread& spread);

/// ",median,low,high", with 17 digits.
void append_spread(const Spread& spread, std::string& text);

}  // namespace sprag::tolerance
