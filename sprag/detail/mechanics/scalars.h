// Common numerical constants and helpers.
#pragma once

#include <cstddef>
#include <limits>

namespace sprag {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double machine_epsilon = std::numeric_limits<double>::epsilon();

/// log sqrt(2 pi), the negative logarithm of the standard normal density at 0.
inline constexpr double half_log_two_pi = 0.91893853320467274178;

/// x * x exactly. std::pow may differ from it without optimization, and between translation units.
constexpr double square(double x) { return x * x; }

/// i >= 0 as a container index.
constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace sprag
