/// \file
/// \brief Fixed-interval smoother: runs the event filter forward over a recording and then
/// backward, so that each event contributes to the whole path.
///
/// Each step of the forward filter (event_filter.h) records the whitened state xi_k before it,
/// given the whitened state after it:
///
///     xi_k = mean_k + on_next_k xi_k+1 + rest_k zeta.
///
/// If xi_k+1 has the smoothed mean a and the root B, then xi_k has the mean mean + on_next a and a
/// root of on_next B B^T on_next^T + rest rest^T. No covariance is inverted. The step includes the
/// mixture over the time of its event. Each pass is linearized about the path of the pass before
/// (Gauss-Newton), until the path converges.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief The scene cannot be smoothed; what() gives the reason.
struct SmoothingError : Error {
  using Error::Error;
};

/// \brief Estimate at one tick: f coordinates, m contacts.
struct SmoothedEstimate {
  /// \brief Mean and standard deviations of q and u (f entries each), standard deviations of the
  /// gaps (m entries) and of the model's outputs.
  Eigen::VectorXd q, u, sigma_q, sigma_u, sigma_gap, sigma_outputs;
};

/// \brief Part of a recording that is smoothed.
struct SmoothedStretch {
  double from = 0.0, to = 0.0;  ///< [s]
  std::size_t events = 0;       ///< events in [from, to]
  /// \brief Mean normalized innovation squared of its events. It is about 1 if model, jitter and
  /// drift are right, and less than 1 if the machine drifts less than the scene states.
  double misfit = 0.0;
};

/// \brief Smooths a recording that has every event since t = 0.
///
/// A reset of the filter ends a stretch: events after it do not contribute to ticks before it. At
/// ticks outside of stretches the estimate is that of EstimatorKind::both. Parameters of
/// [parameters] are estimated, also those with `consider`.
/// \param scene machine, start and uncertainties.
/// \param events in order of time; contacts from 0.
/// \param h step between ticks [s].
/// \param last number of the last tick.
/// \param take take(k, estimate, smoothed), called for the ticks k = 0 ... last in order;
/// `smoothed` is true inside a stretch.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return the stretches, in order of time.
/// \throws ModelError if the machine has no exact flow.
/// \throws SmoothingError if the scene has neither jitter nor
/// uncertain parameters, or no force, clearance or support motion sets the scale of the motion.
/// \throws Interrupted if `stop` was requested.
std::vector<SmoothedStretch> smooth(
    const Scene& scene, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const SmoothedEstimate&, bool)>& take,
    std::stop_token stop = {});

}  // namespace sprag
