// The estimator of the observer programs: a replica, and for `timing`, `both` and `adaptive` also
// the event filter (event_filter.h), which estimates the state, its covariance and the uncertain
// parameters.
//
// `timing` and `both` start the filter at the first tick from the prior of the scene: uncertainty
// of the start and [parameters]. `adaptive` shows the replica until adopt() starts the filter from
// the posterior of an identification (machine_adaptation.h).
//
// Supervision (track.h):
//
// * While the track is confirmed, the estimate is the filter's.
// * The filter rejects one spurious event and bridges one missing event of a confirmed track.
// * While an event is overdue, no sigma is claimed. An impact that stays away for `clear_share` of
//   the flight's duration is missing.
// * After any other gate failure the track is lost. `both` and `adaptive` then show the replica.
//   The filter resets its state to the replica's, at this event or at the next one.
// * `timing` shows the filter from then on, with infinite deviations until it is confirmed.
// * Parameters with a prior return to it after a failure before confirmation. Others are identified
//   again from the events since.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sprag/detail/estimates/predictor.h"
#include "sprag/detail/filter/belief_pool.h"
#include "sprag/detail/filter/scene_filter.h"
#include "sprag/detail/filter/track.h"
#include "sprag/detail/identification/task.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/prediction.h"

namespace sprag {

/// Supervision of the time without reports: overdue and missing events.
struct Silence {
  double last_received = 0.0;  ///< time of the last report, or of a missing event, a burst's end or
                               ///< a reset after it [s]
  double last_flight = 0.0;    ///< interval from the previous such time to it [s]
  double next_look = 0.0;      ///< time of the next check for an overdue event [s]
  double open_until = 0.0;     ///< the last check excludes an overdue event up to this time [s]
  /// Contact whose event is overdue, -1: none; set by a check, cleared by received_at().
  int overdue = -1;
  double overdue_since = 0.0;  ///< time of the check that found it [s]
  double missing_from = 0.0;   ///< the overdue event counts as missing from this time [s]
};

/// Track of the filter's estimate (track.h).
struct Track {
  TrackStatus status = TrackStatus::lost;
  bool doubts = false;  ///< a spurious or a missing event was just tolerated; set by doubt(),
                        ///< cleared by the next event that fits or by the loss of the track
  /// The prior's scale of the motion is still in the estimate; cleared by the loss of the track,
  /// except while a contact may have started inside its support.
  bool scale_is_known = true;
  std::int64_t fitting = 0;  ///< events in a row that fit, since the last start or reset
  std::int64_t trial = 0;    ///< events that must fit before confirmation, besides 2f
  /// Inflation factor of the prior standard deviations at the next reset, >= 1.
  double inflation = 1.0;
  /// Exponential mean of the normalized innovations squared (innovation_window).
  double mean_square = 1.0;
  double energy = 0.0;  ///< twice the energy of the replica's motion, its largest value so far
};

/// The estimator's state. Copies do not allocate. Valid while its estimator lives.
struct TrackingState {
  std::int64_t tick = 0;  ///< number of the present tick
  ContactSet chi = 0;     ///< contacts closed by the events so far
  ReplicaState replica;
  std::int64_t events = 0;   ///< number of events since the start
  std::int64_t changed = 0;  ///< if the machine has changed: number of the event at which it did
  std::int64_t identifications = 0;  ///< number of results taken, accepted or not
  double accepted = -1.0;  ///< time at which the last accepted result, or the prior, took effect;
                           ///< -1: none in effect [s]
  BeliefRef belief;        ///< empty before the first accepted identification
  /// Beliefs before the last events, latest first, for ticks that may precede several of them.
  std::array<BeliefRef, 3> earlier;
  Silence silence;
  Track track;
  ContactSet inside = 0;  ///< contacts that may have started inside their support: set by a closing
                          ///< at t = 0 if the scene admits it, cleared by the contact's opening
  std::int64_t inconsistencies = 0;
  Inconsistency last;
  /// Number of beliefs that found no room in the pool; each loses the track.
  std::int64_t forgotten = 0;
};

class TrackingEstimator {
 public:
  using State = TrackingState;

  /// \param h        interval of the ticks, > 0 [s]
  /// \throws ModelError             if the machine has no exact flow
  /// \throws std::invalid_argument  for an unknown key in scene.prior.adaptation
  TrackingEstimator(const Scene& scene, double h, EstimatorKind kind = EstimatorKind::both);

  void start(const sprag::State& start, std::int64_t k, ContactSet chi, TrackingState& state);
  void tick(std::span<const ContactEvent> events, TrackingState& state);
  /// As Replica::coast(), at most up to the next check for an overdue event.
  std::int64_t coast(std::int64_t n, TrackingState& state);
  bool coasts() const { return !identifies(); }
  void apply(std::span<const ContactEvent> events, TrackingState& state);
  void output(const TrackingState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const TrackingState& state, Confidence& confidence) const;
  void confidence(const TrackingState& state, Confidence& confidence);
  double h() const { return replica_.h(); }

  /// SceneFilter::belief() at the present tick. The track must not be lost. Allocates.
  Eigen::MatrixXd belief(const TrackingState& state, Belief& belief);
  /// As Predictor::predict() from this state. Predicts nothing if the track is not confirmed, and
  /// nothing for `adaptive`. Allocates. Throws Interrupted (interrupt.h).
  Prediction predict(const TrackingState& state, const Predictor& predictor, double ahead);

  /// Appends a record of each event to `records`, which must outlive this; start() clears them.
  /// Only one state may be moved then, and never back; moving it allocates. While the track is
  /// confirmed, times, velocities and impulses are the filter's; forces too if no parameter is
  /// uncertain.
  void record_in(std::vector<ImpactRecord>& records);

  /// Input of the filter between two resets.
  struct FilterRun {
    FilterBelief start;
    std::vector<ContactEvent> events;
    std::vector<double> sigmas;  ///< of the events' times [s]; large for a bridged missing event
    bool failed = false;         ///< ended by a gate failure before confirmation
  };
  /// Appends the filter's runs to `runs`; start() clears them. Requires that the estimator advances
  /// one state only and never rolls back. Recording allocates.
  void record_runs(std::vector<FilterRun>* runs) { runs_ = runs; }
  /// Null if the estimator has no filter.
  SceneFilter* filter() { return filter_.get(); }
  /// Restarts the filter at the present tick from the posterior of an identification. Returns false
  /// if the result is not accepted or not accurate enough; then only counts it. Does not allocate.
  bool adopt(const AdaptationResult& result, TrackingState& state);
  /// The family to identify with (run() in task.h); null if nothing is identified.
  const SceneValues* family() const { return identifies() ? filter_->family.get() : nullptr; }

  /// Whether the estimates rest on a replica of the scene's machine.
  bool has_replica() const { return !identifies() && kind_ != EstimatorKind::timing; }
  /// The replica's estimate at the present tick.
  void replica(const TrackingState& state, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u) const {
    replica_.output(state.replica, q, u);
  }
  Flows& flows() { return replica_.flows(); }

 private:
  bool identifies() const { return identifies_; }
  bool scale_is_lost(const TrackingState& state) const;
  void start_from_prior(const sprag::State& start, double t, TrackingState& state);
  std::int64_t to_confirm(const TrackingState& state) const;
  void receive(std::span<const ContactEvent> of_one_instant, TrackingState& state);
  void take(std::span<const ContactEvent> of_one_instant, TrackingState& state);
  bool shows_filter(const TrackingState& state) const;
  void lose(TrackingState& state) const;
  bool may_doubt(const TrackingState& state) const;
  static void doubt(const Inconsistency& inconsistency, TrackingState& state);
  bool take_missing(TrackingState& state);
  void received_at(double t, TrackingState& state) const;
  static bool is_believed(const TrackingState& state);
  bool claims(const TrackingState& state) const;
  void fail(const Inconsistency& inconsistency, TrackingState& state);
  double note_energy(TrackingState& state);
  Suspicion suspicion(const FilterBelief& before, const FilterBelief& after);
  void find_replica(const TrackingState& state, double t);
  void watch(double t, TrackingState& state);
  void look(double t, TrackingState& state);
  double until_next_look(double t, const TrackingState& state) const;
  void describe(const BeliefRef& before, const ContactEvent& event, const TrackingState& state,
                ImpactRecord& record);
  void follow_forces(const FilterBelief& before, double t);
  void measure_release(const FilterBelief& before, const ContactEvent& event);
  void reset(double t, std::span<const ContactEvent> events, TrackingState& state);
  void note_start(const FilterBelief& of);
  void note_event(const ContactEvent& event, double sigma);
  bool set_belief(const FilterBelief& of, TrackingState& state) const;
  bool add_belief(const FilterBelief& of, TrackingState& state) const;
  static const FilterBelief& belief_at(double t, const TrackingState& state);

  Replica replica_;
  EstimatorKind kind_;
  std::int64_t trial_;  // before confirmation, without failures
  bool identifies_ = false;
  std::unique_ptr<SceneFilter> filter_;
  std::unique_ptr<ImpactRecorder> recorder_;  // of the replica; null: nothing is recorded
  std::vector<ImpactRecord>* records_ = nullptr;
  std::vector<ImpactRecord> with_forces_;   // records of the filter, with contact forces
  std::unique_ptr<ImpactRecorder> forces_;  // null without records, or with uncertain parameters
  std::vector<FilterRun>* runs_ = nullptr;
  std::size_t recorded_ = 0;  // number of records before the tick under way
};

}  // namespace sprag
