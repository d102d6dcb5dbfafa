// Fixed-interval smoothing: every event of a recording contributes to the whole path. The event
// filter runs forward (event_filter.h), then every step of it is followed back. A step says what
// the whitened state before it is, given that after it:
//
//   xi_k = mean_k + on_next_k xi_k+1 + rest_k zeta.
//
// With the smoothed mean a and root B of xi_k+1 those of xi_k are mean + on_next a and a root of
// on_next B B^T on_next^T + rest rest^T, so that no covariance is inverted. The mixture over an
// event's time is in the step. Passes are linearized about the path of the one before, until it
// stays: Gauss-Newton.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"
#include "sprag/scene.h"

namespace sprag {

/// A scene that cannot be smoothed; what() says why.
struct SmoothingError : Error {
  using Error::Error;
};

/// Mean and standard deviations of q and u, f entries each, and those of the gaps, m entries, and
/// of the model's outputs.
struct SmoothedEstimate {
  Eigen::VectorXd q, u, sigma_q, sigma_u, sigma_gap, sigma_outputs;
};

/// A part of a recording that is smoothed.
struct SmoothedStretch {
  double from = 0.0, to = 0.0;  ///< [s]
  std::size_t events = 0;
  /// Mean of the normalized innovations squared of its events: about 1 where model, jitter and
  /// drift are right, less where the machine drifts less than the scene says.
  double misfit = 0.0;
};

/// Smooths a recording that has every event since t = 0, with ticks h [s]. Where the filter resets,
/// a stretch ends: later events say nothing of it. Where it does not fit, the estimate is that of
/// EstimatorKind::both. Parameters of [parameters] are estimated, also those that are only
/// considered elsewhere. take(k, estimate, smoothed) for ticks 0 to `last` in order. Throws
/// ModelError; SmoothingError where the scene has neither jitter nor uncertain parameters, or
/// events do not set the scale of the machine's motion; Interrupted.
std::vector<SmoothedStretch> smooth(
    const Scene& scene, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const SmoothedEstimate&, bool)>& take);

}  // namespace sprag
