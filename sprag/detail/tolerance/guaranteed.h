// Largest deviation for which the guaranteed bound stays below the target: proven, not measured.
#pragma once

#include <optional>

#include "sprag/detail/tolerance/search.h"

namespace sprag::tolerance {

/// The largest limit of event times, of a restitution, or of a factor on stiffness or damping, for
/// which the median of B in the second half of the first run is below the target, without other
/// deviations. Empty if the bound does not cover the deviation or the machine has no bound. Throws
/// ModelError or Interrupted.
std::optional<Limit> guaranteed_limit(const Bench& bench, const Deviation& deviation);

}  // namespace sprag::tolerance
