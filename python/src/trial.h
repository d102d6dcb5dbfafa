// One run of a machine with its observers: the motion of the machine, the estimates from the
// disturbed events, and figures of their error.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
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

/// Runs an estimator from `start` with the events as they arrive, tick by tick, and visits its
/// state at every sample 0 ... truth.samples(). Identifications of an adaptive estimator are
/// computed at once. Throws Interrupted.
void pursue(
    TrackingEstimator& estimator, const State& start, std::span<const ContactEvent> events,
    const Truth& truth,
    const std::function<void(Eigen::Index sample, const TrackingEstimator::State& state)>& visit);

/// Figures of one estimator in one run. V is (23) of Baumann & Leine 2014. "Settled" means the
/// second half of the run.
struct Figures {
  double V_floor = 0.0;  ///< median of V, settled
  double V_max = 0.0;    ///< largest V, settled
  /// Rate of decay of V: ln(V(0) / V(t)) / t at the first sample t at which V is at most ten times
  /// the floor.
  double rate = 0.0;
  double time_below = 0.0;  ///< first sample with V below the threshold [s]; infinity: none
  double nees = 0.0;        ///< mean of (error / sigma)^2 of all q and u, settled; NaN: no filter
  double beyond_3_sigma = 0.0;  ///< fraction of these errors beyond 3 sigma; NaN: no filter
  double trusted = 0.0;         ///< fraction of samples from the filter; NaN: no filter
  double worse = std::numeric_limits<double>::quiet_NaN();  ///< see add_worse()
  std::vector<double> V;  ///< at the samples, from the start on; infinity where it is not finite
};

/// Runs an estimator. `scene` is its model of the machine, with the start of the estimate. It may
/// have fewer coordinates than the machine; the missing ones count as zero. `events` are those that
/// arrive. threshold 0: 1e-4 of V at the start. Throws as the constructor of TrackingEstimator, or
/// Interrupted.
Figures follow(EstimatorKind estimator, const Scene& scene, std::span<const ContactEvent> events,
               const Truth& truth, double threshold);

/// Sets `worse` of all estimators except the replica: the fraction of settled samples at which V is
/// more than ten times the replica's, and above the rounding level, 1e-20 of V at the start.
/// Without a replica in `kinds` it stays NaN. `figures` are those of `kinds` in one run.
void add_worse(std::span<const EstimatorKind> kinds, std::span<Figures> figures);

}  // namespace sprag::python
