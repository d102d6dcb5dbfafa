// How much may be off for the guaranteed bound to stay below the target: proven, not measured.
#pragma once

#include <optional>

#include "tools/tolerance/search.h"

namespace sprag::tolerance {

/// The largest limit of event times, of a restitution, or of a factor on stiffness or damping, with
/// which the median of B in the second half of the first run is below the target; nothing else is
/// off. None where the bound covers no such deviation, or the machine has no bound. Throws
/// ModelError or Interrupted.
std::optional<Limit> guaranteed_limit(const Bench& bench, const Deviation& deviation);

}  // namespace sprag::tolerance
