// One run of a machine with its observers: what the machine does, what an estimator makes of the
// events that it is told, and figures of its error.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/scene.h"

namespace sprag::study {

/// A machine's run, and its states at sampled ticks.
struct Truth {
  Model model;
  std::vector<ContactEvent> events;  ///< up to the duration
  double tick = 0.0;                 ///< of the observer [s]
  std::int64_t stride = 1;           ///< ticks between samples
  Eigen::MatrixXd q, u;              ///< f x samples + 1: column k at tick k stride

  std::int64_t samples() const { return q.cols() - 1; }
  double interval() const { return static_cast<double>(stride) * tick; }  ///< of samples [s]
};

/// Samples at most, at least two, evenly over the duration > 0; tick 0: one tick a sample. Throws
/// ModelError, SimulationError, Interrupted, or Error where there are fewer than two ticks.
Truth run_machine(const Scene& machine, double duration, double tick, int samples);

/// Tells an estimator, which starts from `start`, the events as they arrive, tick by tick of the
/// truth, and visits its state at every sample, 0 ... truth.samples(). What the adaptive one wants
/// identified is, at once. Throws Interrupted.
void pursue(
    TrackingEstimator& estimator, const State& start, std::span<const ContactEvent> events,
    const Truth& truth,
    const std::function<void(Eigen::Index sample, const TrackingEstimator::State& state)>& visit);

/// What comes of one estimator in one run. V is (23); "settled": in the second half of the run.
struct Figures {
  double V_floor = 0.0;  ///< median of V, settled
  double V_max = 0.0;    ///< largest V, settled
  /// ln(V(0) / V(t)) / t at the first sample t at which V is at most ten times the floor: the rate
  /// at which V falls.
  double rate = 0.0;
  double time_below = 0.0;  ///< first sample with V below the threshold [s]; infinity: none
  double nees = 0.0;        ///< mean of (error / sigma)^2 of all q and u, settled; NaN: no filter
  double beyond_3_sigma = 0.0;  ///< share of them beyond 3 sigma; NaN: no filter
  double trusted = 0.0;         ///< share of samples that are the filter's; NaN: no filter
  double worse = std::numeric_limits<double>::quiet_NaN();  ///< see add_worse()
  std::vector<double> V;  ///< at the samples, from the start on; infinity where it is not finite
};

/// `told` is the machine as the estimator knows it, with the start of its estimate; it may have
/// fewer coordinates than the machine: what they lack counts as zero. `events` as they arrive.
/// threshold 0: 1e-4 of V at the start. Throws as TrackingEstimator's constructor, or Interrupted.
Figures follow(EstimatorKind estimator, const Scene& told, std::span<const ContactEvent> events,
               const Truth& truth, double threshold);

/// A run, as an estimator is told of it.
struct Told {
  const Scene& scene;
  std::span<const ContactEvent> events;
  const Truth& truth;
};

/// What follow() gives for the replica of each run, bit for bit, but in a fraction of the time:
/// runs of one structure, with the same ticks, go side by side (replica_sweep.h). None for a run
/// that has to be followed alone: of no other is the structure the same, its ticks are no more than
/// its samples, which leaves nothing to gain, or one of those beside it throws. Throws Interrupted.
std::vector<std::optional<Figures>> follow_replicas(std::span<const Told> runs, double threshold);

/// Of all but the replica: the share of settled samples at which V is more than ten times the
/// replica's, and above rounding, 1e-20 of V at the start. Without a replica in `kinds` it stays
/// NaN. `figures` are those of `kinds` in one run.
void add_worse(std::span<const EstimatorKind> kinds, std::span<Figures> figures);

}  // namespace sprag::study
