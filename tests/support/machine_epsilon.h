#pragma once

#include <limits>

namespace sprag {

/// Of a double. Not `epsilon`, which is the coefficient of restitution.
inline constexpr double machine_epsilon = std::numeric_limits<double>::epsilon();

}  // namespace sprag
