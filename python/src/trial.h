// One run of a machine with its observers: the motion of the machine, the estimates from the
// disturbed events, and figures of their error.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/events/disturbance.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/scene.h"

namespace sprag::python {

/// Draws random starts: of the machine with this error energy about the scene's, and of the replica
/// about the machine's. The energy 0, or none of the replica, leaves a start as it is. Throws Error
/// if no start outside the supports is found.
void draw_starts(std::uint64_t seed, std::uint64_t stream, double of_machine,
                 std::optional<double> of_replica, Scene& machine, Scene& observer);

/// The events as they arrive: a pure function of its arguments. With the same seed and stream the
/// noise is proportional to the jitter, and events lost at a small fraction are also lost at a
/// larger one.
std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed, std::uint64_t stream);

/// A machine's run: its events and its states at sampled ticks.
struct Truth {
  Model model;
  std::vector<ContactEvent> events;  ///< up to the duration
  double tick = 0.0;                 ///< of the observer [s]
  std::int64_t stride = 1;           ///< ticks between samples
  double end = 0.0;                  ///< the duration [s]
  Eigen::MatrixXd q, u;              ///< f x samples + 1: column k at tick k stride

  std::int64_t samples() const { return q.cols() - 1; }
  double interval() const { return static_cast<double>(stride) * tick; }  ///< of samples [s]
};

/// Runs the machine over the duration > 0 with at most `samples` samples, at least two, evenly
/// spaced. tick 0: one tick per sample. Throws ModelError, SimulationError, Interrupted, or Error
/// if there are fewer than two ticks.
Truth run_machine(const Scene& machine, double duration, double tick, int samples);

/// One estimator in one run. "Settled" means the second half of the run.
struct Figures {
  std::vector<double> V;  ///< at the samples, from the start on; infinity where it is not finite
  /// Mean of (error / sigma)^2 of all q and u, settled; the fraction of these errors beyond 3
  /// sigma; and the fraction of samples from the filter. NaN: no filter.
  double nees = std::numeric_limits<double>::quiet_NaN(), beyond_3_sigma = nees, trusted = nees;
};

/// Runs an estimator. `scene` is its model of the machine, with the start of the estimate. It may
/// have fewer coordinates than the machine; the missing ones count as zero. `events` are those that
/// arrive. Throws as the constructor of TrackingEstimator, or Interrupted.
Figures follow(EstimatorKind estimator, const Scene& scene, std::span<const ContactEvent> events,
               const Truth& truth);

}  // namespace sprag::python
