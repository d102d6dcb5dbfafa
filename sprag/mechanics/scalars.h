// What every unit needs of real numbers.
#pragma once

#include <limits>

namespace sprag {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// Not std::pow, which without optimization is not that product, and not the same in other units.
constexpr double square(double x) { return x * x; }

}  // namespace sprag
