// The estimator of the observer programs: a replica, and beside it, where `timing`, `both` or
// `adaptive` asks for it, the event filter (event_filter.h), which estimates the state, its
// covariance and the uncertain parameters.
//
// `timing` and `both` start the filter at the first tick from the prior of the scene: uncertainty
// of the start and [parameters]. `adaptive` shows the replica until enough events have come, then
// wants an identification (wanted(), task.h); where its result is accepted, the filter starts from
// its posterior.
//
// Supervision (track.h). While the track is confirmed the estimate is the filter's. The filter
// rejects one spurious event and bridges one missing event of a confirmed track. Nothing is claimed
// while an impact is overdue; where it stays away for a share of the flight's duration that no
// model is wrong by, it is missing. Where another event does not fit, the track is lost: the
// estimate of `both` and `adaptive` is the replica's, and the filter resets its state to the
// replica's at the next event, or at this one. `timing` shows the filter from then on, with
// infinite deviations until it is confirmed. Parameters with a prior return to it after a failure
// before confirmation; others are identified anew from the events since.
//
// An identification is wanted in the state of a tick, and of the events up to it; its result counts
// from the next tick on. So settled ticks must not go on before put() was called; ticks for now do.
// What is settled then depends on the events alone.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sprag/detail/filter/belief_pool.h"
#include "sprag/detail/filter/scene_filter.h"
#include "sprag/detail/filter/track.h"
#include "sprag/detail/identification/task.h"
#include "sprag/detail/replica/any_replica.h"
#include "sprag/prediction.h"

namespace sprag {

/// Events since the last one that is known to be of another machine, for an identification.
struct EventWindow {
  std::int64_t events = 0;           ///< since the start
  std::int64_t first = 0;            ///< of the window
  double begins = 0.0;               ///< when all events are known since [s]
  ContactSet closed = 0;             ///< there
  std::int64_t size = 0;             ///< of the window when the next identification is wanted
  bool wanted = false;               ///< one is, of all events up to this tick
  std::int64_t identifications = 0;  ///< whose results counted
  double accepted = -1.0;            ///< when the last result or prior was taken [s]
};

/// Time since the last event, and what should have been reported in it.
struct Silence {
  double last_received = 0.0;  ///< the last event's report, or what took its place [s]
  double last_flight = 0.0;    ///< from the event before to it [s]
  double next_look = 0.0;      ///< for an overdue impact [s]
  int overdue = -1;            ///< contact whose impact is; -1: none
  double overdue_since = 0.0;
  double missing_from = 0.0;  ///< when it counts as missing [s]
};

/// How the filter's estimate is judged (track.h).
struct Track {
  TrackStatus status = TrackStatus::lost;
  bool doubts = false;         ///< the last event was spurious, or one was missing
  bool scale_is_known = true;  ///< the track has not been lost since the start
  std::int64_t fitting = 0;    ///< events in a row that fitted, since the last start or reset
  std::int64_t trial = 0;      ///< events to fit before confirmation, beside 2f
  double inflation = 1.0;      ///< of the prior standard deviations at the next reset, >= 1
  double mean_square = 1.0;    ///< of the normalized innovations, over about the last 16
  double energy = 0.0;         ///< twice that of the replica's motion, its largest at an event
};

/// Everything that changes; copies do not allocate. Valid while its estimator lives.
struct TrackingState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  AnyReplica::State base;
  EventWindow window;
  BeliefRef belief;  ///< none before the first result of an identification
  /// Those before its last events, the latest first: for ticks that precede several of them.
  std::array<BeliefRef, 3> earlier;
  Silence silence;
  Track track;
  ContactSet inside = 0;  ///< closed since t = 0, where the machine may have started inside
  std::int64_t inconsistencies = 0;
  Inconsistency last;
  std::int64_t forgotten = 0;  ///< how often there was no room for its belief
};

class TrackingEstimator {
 public:
  using State = TrackingState;

  /// Tick h > 0 [s]; `stepper` is that of a plain replica. Throws ModelError, also where the
  /// scene's damping couples the modes and parameters are uncertain; and std::invalid_argument for
  /// a key in scene.adaptation that is none.
  TrackingEstimator(const Scene& scene, double h, EstimatorKind kind = EstimatorKind::both,
                    StepperKind stepper = StepperKind::exact, TrackThresholds thresholds = {});

  void start(const sprag::State& start, std::int64_t k, ContactSet chi, TrackingState& state);
  void tick(std::span<const ContactEvent> events, TrackingState& state);
  /// As Replica's; up to the next look for an overdue impact.
  std::int64_t coast(std::int64_t n, TrackingState& state);
  bool coasts() const { return !identifies() && base_.coasts(); }
  void apply(std::span<const ContactEvent> events, TrackingState& state);
  void output(const TrackingState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const TrackingState& state, Confidence& confidence) const;
  void confidence(const TrackingState& state, double initial, Confidence& confidence);
  double h() const { return base_.h(); }

  /// SceneFilter::belief() at the present tick, of a track that is not lost. Allocates.
  Eigen::MatrixXd belief(const TrackingState& state, Belief& belief);
  /// As Predictor::predict() from this state; nothing is predicted where the track is not
  /// confirmed, and by an estimator that identifies. Allocates. Throws Interrupted (interrupt.h).
  Prediction predict(const TrackingState& state, const Predictor& predictor, double ahead);

  /// As AnyReplica's. While the estimate is the filter's, times, velocities and impulses are its
  /// own, and forces where no parameter is uncertain.
  bool record_in(std::vector<ImpactRecord>& records);

  /// What the filter goes through between two resets.
  struct FilterRun {
    FilterBelief start;
    std::vector<ContactEvent> events;
    std::vector<double> sigmas;  ///< of the events' times [s]; an unreported one has a large sigma
    bool failed = false;         ///< ended by an event that did not fit, before confirmation
  };
  /// Appends the runs of the filter from now on to `runs`, of an estimator of which one state alone
  /// is moved, and never back. Allocates then.
  void record_runs(std::vector<FilterRun>* runs) { runs_ = runs; }
  /// Null for a plain replica.
  SceneFilter* filter() { return filter_.get(); }
  /// Whether the next tick of this state waits for a result that has not been put.
  bool waits(const TrackingState& state) const;
  /// What it waits for. `task` keeps its room, so that no call allocates that has some of
  /// most_events.
  void wanted(const TrackingState& state, AdaptationTask& task) const;
  /// From now on ticks after a state that wants it take it; it must stay as it is until another
  /// one is put. Does not allocate.
  void put(const AdaptationResult& result) { result_ = &result; }
  /// What results are made with; null where nothing is identified.
  const MachineFamily* family() const { return identifies() ? filter_->family.get() : nullptr; }

  /// In a task. A state that identifies may be as many events ahead of one to go on from.
  static constexpr std::int64_t most_events = 1024;

  /// As AnyEstimator's; not of one that identifies: its machine may be another than the scene's.
  bool has_replica() const {
    return !identifies() && kind_ != EstimatorKind::timing && base_.is_exact();
  }
  void replica(const TrackingState& state, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u) const {
    AnyReplica::exact_output(state.base, q, u);
  }
  Flows* flows() { return base_.flows(); }
  const char* flow_path() { return base_.flow_path(); }

 private:
  struct ReportedEvent {
    ContactEvent event{};
    ContactSet chi_before = 0;
    double before = 0.0;  // when the event before it was
  };
  bool identifies() const { return identifies_; }
  bool scale_is_lost(const TrackingState& state) const;
  void start_from_prior(const sprag::State& start, TrackingState& state);
  ReportedEvent& reported(std::int64_t event) {
    return received_[static_cast<std::size_t>(event) % received_.size()];
  }
  const ReportedEvent& reported(std::int64_t event) const {
    return received_[static_cast<std::size_t>(event) % received_.size()];
  }
  std::int64_t first_size() const;
  std::int64_t to_confirm(const TrackingState& state) const;
  bool has_result(const TrackingState& state) const;
  void take_result(TrackingState& state);
  void hear(std::span<const ContactEvent> of_one_instant, TrackingState& state);
  void end_tick(TrackingState& state);
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
  void begin_window(std::int64_t event, TrackingState& state) const;
  void find_replica(const TrackingState& state, double t);
  void watch(double t, TrackingState& state);
  bool look(double t, TrackingState& state);
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

  AnyReplica base_;
  EstimatorKind kind_;
  TrackThresholds thresholds_;
  bool identifies_ = false;
  std::unique_ptr<SceneFilter> filter_;
  // Ring, by number of event, where parameters are identified: those of a task, and as many again
  // of states that run ahead.
  std::vector<ReportedEvent> received_;
  const AdaptationResult* result_ = nullptr;
  std::vector<ImpactRecord>* records_ = nullptr;
  std::vector<ImpactRecord> with_forces_;   // of the filter
  std::unique_ptr<ImpactRecorder> forces_;  // null: no records, or uncertain parameters
  std::vector<FilterRun>* runs_ = nullptr;
  std::size_t recorded_ = 0;  // of them, before the tick under way
};

/// Runs the identification that the state waits for, if any, into `result` and puts it. True if so.
/// Allocates. Throws Interrupted (interrupt.h).
bool identify_now(TrackingEstimator& estimator, const TrackingState& state,
                  AdaptationResult& result);

}  // namespace sprag
