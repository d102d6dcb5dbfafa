// Estimate of a restitution that scatters from impact to impact, like that of a ball on a rough
// floor:
//
//   epsilon_k ~ N(epsilon, scatter^2).
//
// The scatter, and the jitter if it is not specified, maximize the restricted likelihood of
// linearized_filter.h.
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Estimates the scatter for a fit that sought a restitution. Empty if it did not, if the times are
/// exact, or if the residuals are so large that the fit may have found other values than the
/// machine's.
std::optional<RestitutionScatter> estimate_restitution_scatter(const Scene& scene,
                                                               const Identification& fit);

}  // namespace sprag
