// Estimate of the process noise `drift` of the timing filter (uncertainty.h) from impact times. The
// drift, and the jitter if it is not specified, maximize the restricted likelihood (Patterson &
// Thompson 1971) of linearized_filter.h. It accounts for the part of a drift that the fitted
// unknowns absorb.
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Estimates the drift for a fit to events of `scene` that has a minimum, accepted or not. The
/// jitter is estimated too, unless the fit has a specified one above 0. Empty if the residuals are
/// so large that the fit may have found other values than the machine's.
std::optional<DriftEstimate> estimate_drift(const Scene& scene, const Identification& fit);

}  // namespace sprag
