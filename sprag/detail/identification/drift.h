// How far a machine departs from its model: the `drift` that the timing filter should be told
// (uncertainty.h), from the times of impacts. Drift, and the jitter where it is not told, maximize
// the restricted likelihood (Patterson & Thompson 1971) of linearized_filter.h: what the fit of the
// unknowns takes up of a drift does not count as none.
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Of a fit to events of `scene` that has a minimum, whether it is believed or not. The jitter is
/// sought as well unless the fit was told one above 0. None where the fit leaves so much that it
/// may be to other values than the machine's.
std::optional<DriftEstimate> estimate_drift(const Scene& scene, const Identification& fit);

}  // namespace sprag
