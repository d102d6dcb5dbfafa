// Estimate of a restitution that depends on the speed of the impact:
//
//   epsilon = epsilon_0 + trend (|gamma-| - usual |gamma-|).
//
// The trend is estimated to first order together with all fitted parameters (linearized_filter.h).
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Estimates the trend for a fit that sought a restitution. Empty if it did not, if the times are
/// exact, or if the residuals are so large that the fit may have found other values than the
/// machine's. A significant drift or scatter of `beside` adds to the variances.
std::optional<RestitutionTrend> estimate_restitution_trend(const Scene& scene,
                                                           const Identification& fit,
                                                           const Departure& beside = {});

}  // namespace sprag
