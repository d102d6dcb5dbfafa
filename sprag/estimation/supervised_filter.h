// A replica and a timing filter side by side. The filter knows the state after a few events if
// model and events are right; the replica converges whatever the filter does. So the filter's
// innovations are watched, at each instant with events: each against the variance that the filter
// expects of it, and their mean over about 16; and whether an event has not come that had to. While
// they fit, the estimate is the filter's. Where they do not, it is the replica's, and the filter
// starts again from there; it is believed again after the 2 f events that determine it and as many
// more as a probation takes, which grows if the model fails again and again.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sprag/estimation/confidence.h"
#include "sprag/estimation/innovation.h"
#include "sprag/estimation/replica.h"
#include "sprag/estimation/timing_filter.h"

namespace sprag {

/// Everything that changes, at tick `tick`. Copies between states of one estimator do not allocate.
struct SupervisedState : ReplicaState {
  TimingState filter;
  bool trusted = true;
  Probation probation;
  std::int64_t inconsistencies = 0;
  Inconsistency last;
  std::int64_t begun = 0;  ///< how many instants with events the filter had met when it last began
  double energy = 0.0;     ///< of the replica's motion, its largest at an event
};

class SupervisedFilter {
 public:
  using State = SupervisedState;

  /// Throws ModelError, as Replica and TimingFilter.
  SupervisedFilter(const Model& model, double h, Uncertainty uncertainty);
  SupervisedFilter(const Scene& scene, double h)
      : SupervisedFilter(scene.model, h, uncertainty_of(scene)) {}

  /// As Replica's.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, SupervisedState& state);
  void tick(std::span<const ContactEvent> events, SupervisedState& state);
  void apply(std::span<const ContactEvent> events, SupervisedState& state);

  /// The estimate at the present tick, f entries each.
  void output(const SupervisedState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u);

  /// Room for what confidence() says, without allocating: what the filter says where it is trusted,
  /// else infinite deviations; the replica's bound; `initial` as Replica's.
  Confidence no_confidence() const;
  void note(const SupervisedState& state, Confidence& confidence) const;
  void confidence(const SupervisedState& state, double initial, Confidence& confidence);

  /// Appends what is said of each event from now on to these, by whoever the estimate is of then,
  /// of a filter that never goes back. Allocates then.
  void record_in(std::vector<ImpactRecord>& records);

  double h() const { return replica_.h(); }
  const Flows& flows() const { return *flows_; }
  Flows& flows() { return *flows_; }
  Replica& replica() { return replica_; }
  TimingFilter& filter() { return filter_; }

 private:
  void record(const SupervisedState& state);
  void supervise(std::int64_t believed, SupervisedState& state);
  void supervise_silence(std::int64_t silences, SupervisedState& state) const;
  Suspicion suspicion(const SupervisedState& state);

  std::shared_ptr<Flows> flows_;
  Replica replica_;
  TimingFilter filter_;
  // null: nothing is recorded
  std::vector<ImpactRecord>* records_ = nullptr;
  std::vector<ImpactRecord> of_replica_, of_filter_;
  std::unique_ptr<ImpactRecorder> replica_recorder_, filter_recorder_;
  Eigen::VectorXd q_, u_;  // scratch
};

}  // namespace sprag
