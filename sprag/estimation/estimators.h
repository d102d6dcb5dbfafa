// What an observer can run: the estimators, how a scene makes them, and one type that is any of
// them.
#pragma once

#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "sprag/estimation/estimator.h"
#include "sprag/estimation/moreau.h"
#include "sprag/estimation/replica.h"
#include "sprag/estimation/supervised_filter.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

enum class StepperKind { exact, moreau };
/// `adaptive` is the replica here; what goes on from it is in adaptation/adaptive_estimator.h.
enum class EstimatorKind { replica, timing, both, adaptive };

/// One of the estimators, chosen when the program runs; itself an Estimator.
class AnyEstimator {
 public:
  struct State {
    std::int64_t tick = 0;
    ContactSet chi = 0;
    std::variant<ReplicaState, MoreauState, TimingState, SupervisedState> of;
  };

  /// Tick h > 0; `stepper` is of the replica alone. Throws ModelError.
  AnyEstimator(const Scene& scene, double h, EstimatorKind kind = EstimatorKind::both,
               StepperKind stepper = StepperKind::exact);

  void start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state);
  void tick(std::span<const ContactEvent> events, State& state);
  /// As Replica's; 0 where this is another one, which has no ticks of which nothing is new.
  std::int64_t coast(std::int64_t n, State& state);
  bool coasts() const { return std::holds_alternative<Replica>(estimator_); }
  void apply(std::span<const ContactEvent> events, State& state);
  void output(const State& state, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const State& state, Confidence& confidence) const;
  void confidence(const State& state, double initial, Confidence& confidence);
  double h() const { return h_; }

  /// As TimingFilter's; false where the estimate is not a filter's.
  bool belief(const State& state, double ahead, Belief& belief);

  /// Appends what it says of each event from now on to `records`, which must outlive this. For an
  /// estimator of which one state alone is moved, and never back. Allocates then. False with
  /// Moreau's stepper, which knows no events' own times.
  bool record_in(std::vector<ImpactRecord>& records);

  /// The replica's own estimate, f entries each, of an estimator that has one with exact flow.
  bool has_replica() const;
  void replica(const State& state, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u) const;

  /// What it moves on; null with Moreau's stepper, which needs none.
  Flows* flows();
  /// How it moves in free flight: the path of its exact flow, or "moreau".
  const char* flow_path();

 private:
  double h_;
  std::variant<Replica, MoreauReplica, TimingFilter, SupervisedFilter> estimator_;
  std::unique_ptr<ImpactRecorder> recorder_;
};

/// B(0) of a scene, the sum of its [replica] uncertainty; +infinity where a bound on V cannot be
/// given: no uncertainty of the start, or a machine that drifts, whose event times jitter or whose
/// parameters are uncertain. With tolerances the bound is theirs (sprag/bound/guarantee.h), and
/// this is B(0) whatever else the scene says.
double initial_bound(const Scene& scene);

}  // namespace sprag
