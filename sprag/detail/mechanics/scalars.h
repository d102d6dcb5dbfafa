// What every unit needs of numbers.
#pragma once

#include <cstddef>
#include <limits>

namespace sprag {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double machine_epsilon = std::numeric_limits<double>::epsilon();

/// log of the square root of 2 pi: less the log of the normal density at 0.
inline constexpr double half_log_two_pi = 0.91893853320467274178;

/// Not std::pow, which without optimization is not that product, and not the same in other units.
constexpr double square(double x) { return x * x; }

/// i >= 0, as standard containers count.
constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace sprag
