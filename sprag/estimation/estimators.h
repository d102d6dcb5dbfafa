// What an observer can run: the estimators, how a scene makes them, and what each says of its own
// error.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "sprag/estimation/confidence.h"
#include "sprag/estimation/moreau.h"
#include "sprag/estimation/replica.h"
#include "sprag/estimation/supervised_filter.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

enum class StepperKind { exact, moreau };
enum class EstimatorKind { replica, timing, both };

/// The estimator, of one of the types Replica, MoreauReplica, TimingFilter, SupervisedFilter.
template <typename Stepper>
Stepper make_stepper(const Scene& scene, double h) {
  if constexpr (std::is_same_v<Stepper, TimingFilter> ||
                std::is_same_v<Stepper, SupervisedFilter>) {
    return Stepper(scene.model, h, uncertainty_of(scene));
  } else {
    return Stepper(scene.model, h);
  }
}

/// Calls run.operator()<Stepper>() with the type that is asked for.
template <typename Run>
int with_stepper(EstimatorKind estimator, StepperKind stepper, const Run& run) {
  switch (estimator) {
    case EstimatorKind::timing:
      return run.template operator()<TimingFilter>();
    case EstimatorKind::both:
      return run.template operator()<SupervisedFilter>();
    default:
      return stepper == StepperKind::moreau ? run.template operator()<MoreauReplica>()
                                            : run.template operator()<Replica>();
  }
}

/// B(0) of a scene, the sum of its [replica] uncertainty; +infinity where a bound on V cannot be
/// given: no uncertainty, or a machine that drifts or whose event times jitter.
double initial_bound(const Scene& scene);

/// A Confidence with room for all that the estimator says. `f` and `m` as in Model.
template <typename Stepper>
Confidence empty_confidence(Eigen::Index f, int m) {
  Confidence confidence;
  confidence.has_replica =
      std::is_same_v<Stepper, Replica> || std::is_same_v<Stepper, SupervisedFilter>;
  confidence.has_filter =
      std::is_same_v<Stepper, TimingFilter> || std::is_same_v<Stepper, SupervisedFilter>;
  confidence.from_filter = std::is_same_v<Stepper, TimingFilter>;
  if (confidence.has_filter) {
    confidence.sigma_q.setZero(f);
    confidence.sigma_u.setZero(f);
    confidence.sigma_g.setZero(m);
  }
  return confidence;
}

/// Fills a Confidence made by empty_confidence(). `initial`: B(0), +infinity where none holds any
/// longer. They do not allocate.
void confide(Replica& replica, const ReplicaState& state, double initial, Confidence& confidence);
void confide(MoreauReplica& replica, const MoreauState& state, double initial,
             Confidence& confidence);
void confide(TimingFilter& filter, const TimingState& state, double initial,
             Confidence& confidence);
void confide(SupervisedFilter& filter, const SupervisedState& state, double initial,
             Confidence& confidence);

/// Columns of a states CSV that hold a Confidence, behind those of the state; none where nothing is
/// estimated. For a bound alone: `B`, `closing_t`, `closing_contact`, `replica_gap`.
std::vector<std::string> confidence_columns(const Confidence& confidence, double initial);

/// The values in these columns; `values` keeps its room.
void to_columns(const Confidence& confidence, double initial, std::vector<double>& values);

}  // namespace sprag
