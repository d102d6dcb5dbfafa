// Fixed-interval smoothing where parameters are uncertain: the filter of state and parameters runs
// forward (event_filter.h), then every step of it is followed back. A step says what the whitened
// state before it is, given that after it:
//
//   xi_k = mean_k + on_next_k xi_k+1 + rest_k zeta.
//
// With the smoothed mean a and root B of xi_k+1 those of xi_k are mean + on_next a and a root of
// on_next B B^T on_next^T + rest rest^T, so that no covariance is inverted. What the mixture over
// an event time says is in the step.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "sprag/estimation/smoother.h"

namespace sprag {

/// As smooth(), for a scene with [parameters]; a stretch ends where the filter resets. All
/// parameters are estimated, those that are only considered elsewhere too. Throws ModelError,
/// Interrupted.
std::vector<SmoothedStretch> smooth_parameters(
    const Scene& scene, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const Smoother::Estimate&, bool)>& take);

}  // namespace sprag
