// The estimator of the observer programs. Where the parameters of the machine are uncertain, it
// estimates them with the state (event_filter.h); else it is AnyEstimator.
//
// Parameters with a prior. If the scene has [parameters], `timing` and `both` start the filter of
// state and parameters from this prior at the first tick. The estimate is the filter's while its
// innovations fit, else the replica's.
//
// Parameters that are identified (`adaptive`). From the start on the estimate is the replica's.
// Once enough events have come an identification is wanted (wanted(), task.h); where its result is
// accepted, the filter starts from its posterior.
//
// Supervision. The filter rejects one spurious event and bridges one missing event. Where another
// event does not fit, the filter is lost: the estimate is the replica's, and the filter resets its
// state to the replica's and keeps its parameters. It is confirmed after as many events as
// determine the state and a few more. Where events do not fit before that, parameters with a prior
// return to it, and others are identified anew from the events since. A result or a reset is only
// confirmed where the expected energy of the error is a small share of the machine's own.
//
// The filter follows one contact at a time: impacts, chatter, sustained contact. While several
// contacts are closed or hit at once the filter is lost.
//
// When results count. An identification is wanted in the state of a tick, and of the events up to
// it; its result counts from the next tick on. So settled ticks must not go on before put() was
// called; ticks for now do. What is settled then depends on the events alone.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sprag/adaptation/task.h"
#include "sprag/estimation/estimators.h"
#include "sprag/estimation/prediction.h"
#include "sprag/filter/event_filter.h"

namespace sprag {

/// Everything that changes; copies do not allocate.
struct AdaptiveState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  AnyEstimator::State base;

  // Identification.
  std::int64_t events = 0;  ///< since the start
  std::int64_t window = 0;  ///< the first of them that is not known to be of another machine
  double begins = 0.0;      ///< when all events are known since: of that window [s]
  ContactSet closed = 0;    ///< there
  std::int64_t size = 0;    ///< of the window when the next identification is wanted
  bool wanted = false;      ///< one is, of all events up to this tick
  std::int64_t identifications = 0;  ///< whose results counted

  // The filter of state and parameters.
  std::int64_t beliefs = 0;  ///< so many so far; that of the state is the last one
  bool adapted = false;      ///< the filter's parameters are believed
  bool lost = false;         ///< its state is not
  bool trusted = false;      ///< the estimate is the filter's
  bool doubts = false;       ///< the last event was spurious, or one was lost
  std::int64_t fitting = 0;  ///< events in a row that fitted, since the last start or reset
  /// Inflation of the prior standard deviations of the state at the next reset, >= 1. A failure
  /// before confirmation raises it, a confirmation sets it to 1.
  double inflation = 1.0;
  double mean_square = 1.0;  ///< of its innovations, over about the last 16
  double accepted = -1.0;    ///< [s]
  std::int64_t inconsistencies = 0;
  Inconsistency last;
};

class AdaptiveEstimator {
 public:
  using State = AdaptiveState;

  /// As AnyEstimator's; adaptive where `kind` says so. Throws ModelError, also where the scene's
  /// damping couples the modes: there is no filter of parameters for that; and
  /// std::invalid_argument for a key in scene.adaptation that is none.
  AdaptiveEstimator(const Scene& scene, double h, EstimatorKind kind,
                    StepperKind stepper = StepperKind::exact);

  void start(const sprag::State& start, std::int64_t k, ContactSet chi, AdaptiveState& state);
  void tick(std::span<const ContactEvent> events, AdaptiveState& state);
  /// As AnyEstimator's; 0 where this is adaptive.
  std::int64_t coast(std::int64_t n, AdaptiveState& state);
  bool coasts() const { return !joint_ && base_.coasts(); }
  void apply(std::span<const ContactEvent> events, AdaptiveState& state);
  void output(const AdaptiveState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const AdaptiveState& state, Confidence& confidence) const;
  void confidence(const AdaptiveState& state, double initial, Confidence& confidence);
  double h() const { return base_.h(); }

  /// As Predictor::predict() from this state; nothing is foreseen where no covariance is known, and
  /// by an estimator that identifies. Allocates. Throws Interrupted (interrupt.h).
  Prediction predict(const AdaptiveState& state, const Predictor& predictor, double ahead);

  /// As AnyEstimator's. While the estimate is that of the filter of state and parameters,
  /// velocities and impulses are its own; forces are the replica's.
  bool record_in(std::vector<ImpactRecord>& records);

  /// What the filter of uncertain parameters goes through between two resets.
  struct FilterRun {
    FilterBelief start;
    std::vector<ContactEvent> events;
    std::vector<double> sigmas;  ///< of the events' times [s]; an unreported one has a large sigma
    bool failed = false;         ///< ended by an event that did not fit, before confirmation
  };
  /// Appends the runs of the filter from now on to `runs`, of an estimator of which one state alone
  /// is moved, and never back. Allocates then.
  void record_runs(std::vector<FilterRun>* runs) { runs_ = runs; }
  /// The filter of state and parameters; null where parameters are not uncertain.
  EventFilter* filter() { return joint_ ? &joint_->filter : nullptr; }
  /// The estimate of a belief at t, q and u of f entries each.
  void publish(double t, const FilterBelief& of, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u);
  /// After publish(): all deviations.
  void fill_deviations(const FilterBelief& of, Confidence& confidence);

  /// Whether the next tick of this state waits for a result that has not been put.
  bool waits(const AdaptiveState& state) const;
  /// What it waits for. `task` keeps its room, so that no call allocates that has some of
  /// most_events.
  void wanted(const AdaptiveState& state, AdaptationTask& task) const;
  /// From now on ticks behind a state that wants it take it; it must stay as it is until another
  /// one is put. Does not allocate.
  void put(const AdaptationResult& result) { result_ = &result; }
  /// What results are made with; null where nothing is identified.
  const MachineFamily* family() const { return identifies() ? &joint_->family : nullptr; }

  /// Events that a state may be ahead of one that is still to go on from: what is known of its
  /// events is kept so long.
  std::size_t most_ahead() const;

  /// In a task.
  static constexpr std::int64_t most_events = 1024;

  /// As AnyEstimator's; not of one that identifies: its machine may be another than the scene's.
  bool has_replica() const { return !identifies() && base_.has_replica(); }
  void replica(const AdaptiveState& state, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u) const {
    base_.replica(state.base, q, u);
  }
  Flows* flows() { return base_.flows(); }
  const char* flow_path() { return base_.flow_path(); }

 private:
  struct Belief {
    std::int64_t number = -1;  // another one than a state's: it is gone
    FilterBelief of;
  };
  struct Heard {
    ContactEvent event{};
    ContactSet chi_before = 0;
    double before = 0.0;  // when the event before it was
  };
  struct Joint {
    Joint(const Scene& scene, std::vector<Unknown> unknowns, bool from_prior);

    MachineFamily family;
    EventFilter filter;
    std::shared_ptr<const std::vector<std::string>> keys;
    Eigen::MatrixXd to_y, V;    // y of q, q of y
    Eigen::MatrixXd outputs;    // of (y, y'), 2n x the model's outputs
    double sigma = 0.0;         // of event times, with the floor of uncertain parameters [s]
    Eigen::VectorXd stiffness;  // of the modes, as the scene has it
    Eigen::MatrixXd start;      // deviations of a start, 2n x 2n
    Eigen::MatrixXd inflated;   // of a reset
    // Root of the prior covariance of the parameters' coordinates, P x P; empty: they are
    // identified.
    Eigen::MatrixXd prior;
    std::vector<Belief> beliefs;  // ring, by number
    std::vector<Heard> heard;     // ring, by number of event
    // Scratch.
    FilterBelief next;
    Eigen::VectorXd q, u, x;
    Eigen::MatrixXd of_gaps;
    Eigen::RowVectorXd row;
  };

  bool has_prior() const { return joint_ && joint_->prior.size() > 0; }
  bool identifies() const { return joint_ && joint_->prior.size() == 0; }
  void start_from_prior(const sprag::State& start, AdaptiveState& state);
  void set_prior(FilterBelief& belief) const;
  Belief& belief(std::int64_t number) const {
    return joint_->beliefs[static_cast<std::size_t>(number) % joint_->beliefs.size()];
  }
  Heard& heard(std::int64_t event) const {
    return joint_->heard[static_cast<std::size_t>(event) % joint_->heard.size()];
  }
  std::int64_t first_size() const;
  std::int64_t trial() const;
  bool has_result(const AdaptiveState& state) const;
  void take_result(AdaptiveState& state);
  void hear(std::span<const ContactEvent> events, ContactSet chi, AdaptiveState& state);
  void take(const ContactEvent& event, AdaptiveState& state);
  static void lose(AdaptiveState& state);
  static bool may_doubt(const AdaptiveState& state);
  static void doubt(const Inconsistency& inconsistency, AdaptiveState& state);
  bool take_lost(int contact, double t, AdaptiveState& state);
  void fail(const Inconsistency& inconsistency, AdaptiveState& state);
  void begin_window(std::int64_t event, AdaptiveState& state) const;
  void find_replica(const AdaptiveState& state);
  bool is_sure(const FilterBelief& belief, const AdaptiveState& state);
  void watch(AdaptiveState& state);
  void describe(std::int64_t before, const ContactEvent& event, const AdaptiveState& state,
                ImpactRecord& record);
  void restart_filter(AdaptiveState& state);
  void note_start(const FilterBelief& of);
  void note_event(const ContactEvent& event, double sigma);
  void add_belief(const FilterBelief& of, AdaptiveState& state);

  AnyEstimator base_;
  std::unique_ptr<Joint> joint_;
  const AdaptationResult* result_ = nullptr;
  std::vector<ImpactRecord>* records_ = nullptr;
  std::vector<FilterRun>* runs_ = nullptr;
  std::size_t recorded_ = 0;  // of them, before the tick under way
};

/// For who has the time: what the state waits for, if anything, is identified into `result` and
/// put. True if so. Allocates. Throws Interrupted (interrupt.h).
bool identify_now(AdaptiveEstimator& estimator, const AdaptiveState& state,
                  AdaptationResult& result);

}  // namespace sprag
