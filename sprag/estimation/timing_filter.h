// The timing filter: event times as measurements of the state, not only as switches.
//
// Between events the master's own path is affine in its unknown state x = (q, u): free flight or,
// while contacts stay closed, the flow with all of them locked (flow.h). At an instant where the
// contacts A close it jumps by the active branch of the impact law, whatever the signs of gamma in
// the estimate. For one contact
//
//   u+ = u- - (1 + epsilon_i) M^-1 w_i G_ii^-1 gamma_i-,   epsilon_i = 0 where it closes to stay;
//
// for several, and with others that stay closed, the same with G of all of them (Poisson: Lambda =
// -(1 + E) G^-1 gamma-, Newton: Lambda = -G^-1 (1 + E) gamma-). And each event says something of x:
// at a closing g_i = 0, where a chatter ends gamma_i = 0 as well, at a release lambda_i = 0. So
// mean and covariance of x given the events follow from a Kalman filter, exactly for one contact: 2
// f impacts determine 2 f unknowns.
//
// Event times that are off by tau ~ N(0, sigma^2) make each event a mixture over tau
// (event_mixture.h): what it says and does is linear given tau, for any omega_max sigma. The same
// mixture is what is published around an event, when it is not known on which side of it a tick
// lies. Up to the next event its likeliest times stay apart, as Gaussians of one covariance
// (Belief), which are merged again a step later. Where no event comes though the gap has closed,
// nothing is known any longer.
//
// Which contacts take an impulse is not always known: where several close at one instant, or others
// are closed or open at it. There the impact law decides on the mean, and what it would have been
// otherwise widens the covariance.
//
// Deviations are told as long as the innovations fit them. Those of a filter that did not fit, or
// had to begin again, are infinite until it has passed a probation (innovation.h). Where what comes
// at once behind a start does not fit, the next start is less sure.
//
// The covariance is kept as P = S S^T, propagated column by column and conditioned by Potter's
// square root for scalar measurements, so that it cannot turn indefinite and stays accurate
// relative to the smallest of its axes, with exact measurements too. Columns that events add are
// merged by Householder reflections. Covariances belong to instants with events; states share them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sprag/estimation/active_impact.h"
#include "sprag/estimation/belief.h"
#include "sprag/estimation/confidence.h"
#include "sprag/estimation/impact_record.h"
#include "sprag/estimation/innovation.h"
#include "sprag/estimation/ticked_flight.h"
#include "sprag/estimation/uncertainty.h"
#include "sprag/estimation/unknown_time.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/dynamics.h"
#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/flows.h"
#include "sprag/mechanics/impact_law.h"

namespace sprag {

/// How many times the deviations of a start that was too sure the next start has.
inline constexpr double start_widening = 4.0;

/// How the innovations of a filter fit what it holds possible: squares over their variances, which
/// are 1 in the mean where model, events and uncertainty are right.
struct Consistency {
  std::int64_t count = 0;  ///< innovations since the start
  double mean = 1.0;       ///< over about the last 16, weights falling exponentially
  double largest = 0.0;    ///< at the last instant with events

  bool fits() const { return largest <= largest_innovation && mean <= largest_mean_innovation; }
  bool is_lost() const { return largest > impossible_innovation; }  ///< at the last instant
};

/// Everything that changes, at tick `tick`. Copies between states of one filter do not allocate.
struct TimingState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  ContactSet inside = 0;  ///< closed since t = 0, where the machine may have started inside
  /// Thrown off by another's impact, where the reports of that and of the opening are two, of which
  /// one has come: who is in chi is open already, who is not is closed until the impact is told.
  ContactSet thrown = 0;
  double thrown_since = 0.0;  ///< when the first of them was reported [s]
  ContactSet touched = 0;     ///< whose gaps may not be zero where they close next
  Motion motion;              ///< of the mean; t as in ReplicaState
  TickedFlight::Anchor anchor;
  Instant covariance_time;    ///< the instant to which covariance number `instants` belongs
  std::int64_t instants = 0;  ///< instants with events since the start
  Redundancy redundancy;
  std::int64_t refused_impacts = 0;    ///< sets of closed contacts without a flow
  std::int64_t ambiguous_impacts = 0;  ///< decided by the mean
  /// How often it was believed and then did not fit, or so little that it began again.
  std::int64_t misfits = 0;
  std::int64_t silences = 0;  ///< how often an event did not come that had to
  /// The last event that did not come: when that was certain, twice minus the log of the
  /// probability of having heard nothing. Or the last that did not fit; where nothing was known
  /// behind it, of any square.
  Inconsistency last;
  std::int64_t forgotten = 0;  ///< covariances that were gone when they were needed
  bool unknown = false;        ///< nothing is known until the next event
  bool began_again = false;    ///< at the last instant, behind what was not known
  /// Deviations are told. A filter that did not fit, or began again, is on probation.
  bool trusted = true;
  Probation probation;
  /// How many times the told deviations of a start it begins again with: more than one where it was
  /// told to be too sure of that.
  double widened = 1.0;
  /// Of a homogeneous machine: the share of the motion's energy that the events behind a start have
  /// left, its log.
  double log_left = 0.0;
  std::int64_t fitted = 0;       ///< innovations since it last did not fit
  double expected_energy = 0.0;  ///< of the error behind the last instant, where events jitter
  double watched = 0.0;          ///< silence since the last instant is judged up to here [s]
  Eigen::VectorXd last_report;   ///< per contact [s]; none yet: -infinity
  Eigen::VectorXd last_time, last_deviation;  ///< per contact: of its last event, as believed [s]
  Eigen::VectorXi bursts;                     ///< per contact: in a row, up to its last report
  Innovation innovation;
  Consistency consistency;
  Terms terms;  ///< the largest so far
};

class TimingFilter {
 public:
  using State = TimingState;

  /// Tick h > 0. Keeps the covariances of the last 1024 instants with events, fewer of large
  /// machines (64 MiB in all), so that a time line can go back behind as many; further back it
  /// would start from the uncertainty of a start. Throws ModelError.
  TimingFilter(Model model, double h, Uncertainty uncertainty);
  TimingFilter(const Scene& scene, double h)
      : TimingFilter(scene.model, h, uncertainty_of(scene)) {}
  /// The same with flows that others use as well.
  TimingFilter(std::shared_ptr<Flows> flows, double h, Uncertainty uncertainty);
  TimingFilter(const TimingFilter&) = delete;
  TimingFilter& operator=(const TimingFilter&) = delete;

  /// Puts the mean at (q, u) with chi at tick k, with the uncertainty of a start. May allocate.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, TimingState& state);

  /// Puts the mean at (q, u), f entries each, at the instant that it is at. Its covariance is that
  /// of a start times `more` >= 1, and mode by mode as much as the filter, had it heard of no event
  /// since instant number `believed`, would have been unsure of (q, u) or away from it; at most
  /// times `most` >= 1. Who knows where to put the mean judges whether to believe it: deviations
  /// are told at once.
  void restart(const Eigen::Ref<const Eigen::VectorXd>& q,
               const Eigen::Ref<const Eigen::VectorXd>& u, std::optional<std::int64_t> believed,
               double more, double most, TimingState& state);

  /// As Replica's. They do not allocate once the locked sets that occur have been met.
  void tick(std::span<const ContactEvent> events, TimingState& state);
  void apply(std::span<const ContactEvent> events, TimingState& state);

  /// A tick in parts, as Replica's.
  void open_tick(TimingState& state) const;
  void take(std::span<const ContactEvent> of_one_instant, TimingState& state);
  void close_tick(TimingState& state);

  /// Moves the mean from the last instant with events, or the start, to the instant of these, and
  /// applies them. For who needs no ticks: the tick does not count on, and outputs are of no use.
  void follow(std::span<const ContactEvent> events, TimingState& state);

  /// The expectation of the state at the present tick, f entries each.
  void output(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u);

  /// Standard deviations of q and u, f entries each, and of the gaps of all contacts, at the
  /// present tick; infinite where nothing is known, or what is known does not fit.
  void deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                  Eigen::Ref<Eigen::VectorXd> u, Eigen::Ref<Eigen::VectorXd> gap);

  /// Those of the model's outputs, one entry each, at the same.
  void output_deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> outputs);

  /// Room for what confidence() says, without allocating: deviations, the last innovation, and what
  /// did not fit. `initial` does not matter.
  Confidence no_confidence() const;
  void note(const TimingState& state, Confidence& confidence) const;  ///< all but the deviations
  void confidence(const TimingState& state, double initial, Confidence& confidence);

  /// Whether a state's covariance is still kept; deviations begin at the start's where it is not.
  bool remembers(const TimingState& state) const {
    return covariances_[slot_of(state.instants)].instants == state.instants;
  }

  /// Of a contact's gap between the last two instants with events: the share of the time in which
  /// it was negative, its smallest and its largest value [m], and whether it was zero or negative
  /// within 5 % of that time from its end, before or after it.
  struct LastFlight {
    double inside = 0.0;
    double lowest = 0.0, highest = 0.0;
    bool ends_near = false;
  };
  LastFlight last_flight(int contact, const TimingState& state);

  /// Covariance of (q, u) at the present tick, 2 f x 2 f. Allocates.
  Eigen::MatrixXd covariance(const TimingState& state);

  /// What is known at the present tick, the last event taken for certain, with what the model may
  /// depart from it within `ahead` >= 0 [s]. False where nothing is known. Allocates.
  bool belief(const TimingState& state, double ahead, Belief& belief);

  /// Whether events say nothing of how large the motion is (is_homogeneous), and jitter, which is
  /// in proportion to it, keeps the covariance from telling so. Deviations are infinite then.
  bool scale_is_open() const { return is_homogeneous_ && unknown_time_.has_value(); }

  /// Expected energy of the error of a start, of which nothing more is known.
  double energy_of_start() const { return energy_of_start_; }

  /// 1/2 q^T K q + 1/2 u^T M u, of f entries each. Does not allocate.
  double energy(const Eigen::Ref<const Eigen::VectorXd>& q,
                const Eigen::Ref<const Eigen::VectorXd>& u) const;

  /// Records each event from now on, of a filter that never goes back; null: nothing. Allocates
  /// then.
  void record_in(ImpactRecorder* recorder) { recorder_ = recorder; }

  /// Standard deviation of event times [s].
  double jitter() const { return uncertainty_.jitter; }

  double h() const { return h_; }
  const Flows& flows() const { return *flows_; }
  Flows& flows() { return *flows_; }

 private:
  struct Covariance {
    std::int64_t instants = -1;  // another number than a state's: it is gone
    Eigen::Index columns = 0;
    int components = 0;
    std::array<double, Belief::most_components> weights{};
    Eigen::MatrixXd S_q, S_u;  // S, f rows each
    Motion mean;               // as it goes on from there
    UncertainEvent event;      // the event that led to it, where events jitter
  };

  std::size_t slot_of(std::int64_t instants) const {
    return static_cast<std::size_t>(instants % static_cast<std::int64_t>(covariances_.size()));
  }
  Covariance& slot(std::int64_t instants) { return covariances_[slot_of(instants)]; }
  Eigen::Index f() const { return flows_->dynamics().coordinates(); }
  double restitution_of(int contact) const {
    return flows_->dynamics().model().contacts[static_cast<std::size_t>(contact)].restitution;
  }
  void set_looks(const Flow& free);
  double energy_of_error() const;
  double energy_of_motion() const { return energy(now_.q, now_.u) + energy_of_error(); }
  void go_on(TimingState& state);
  bool is_known(const TimingState& state);
  void judge(std::span<const ContactEvent> events, std::int64_t measured, TimingState& state) const;
  ContactSet closed(const TimingState& state) const {
    return (state.chi ^ state.thrown) & ~state.inside;
  }
  bool load(const TimingState& state, Instant t);
  void load(const Covariance& from, Instant t);
  void enter(ContactSet locked, Instant t, TimingState& state);
  void enter(const Flow& flow, Instant t, Motion& motion);
  void enter_motion(const Flow& flow, Instant t, Motion& motion);
  void forget(TimingState& state);
  void widen_start(TimingState& state) const;
  void begin_again(TimingState& state);
  void note(double square, Consistency& consistency) const;
  void note_left(double share, TimingState& state) const;

  // An instant with events.
  void take_instant(std::span<const ContactEvent> events, TimingState& state);
  void take_exact(std::span<const ContactEvent> events, ContactSet before, TimingState& state);
  void note_touched(std::span<const ContactEvent> events, TimingState& state) const;
  void take_uncertain(const ContactEvent& event, ContactSet before, TimingState& state);
  void throw_off(ContactSet thrown, TimingState& state) const;
  bool is_thrown_off(const UncertainEvent& release, const TimingState& state);
  void set_last(double t, const TimingState& state, UncertainEvent& event) const;
  UncertainEvent impact_of(int contact, bool stays, const Motion& motion);
  ContactSet pulled_off(const UncertainEvent& event, const SingleImpact& impact,
                        const Motion& motion);
  ContactSet drop_redundant(ContactSet held, ContactSet closing, TimingState& state) const;
  void measure_release(int contact, TimingState& state);
  void measure_closings(bool several, TimingState& state);
  double condition(double residual, double noise, double scale, TimingState& state);
  void record(std::span<const ContactEvent> events, ContactSet struck, const TimingState& state);
  void record_as_it_is(const ContactEvent& event, const TimingState& state);
  void record_uncertain(const ContactEvent& event, ContactSet held,
                        const UnknownTime::Impact& impact);
  void strike(ContactSet staying, ContactSet leaving, TimingState& state);
  void add_sequence(std::span<const ContactEvent> events, ContactSet before, TimingState& state);
  void add_time_rounding(double share, const TimingState& state);
  void add_unknown(const Eigen::VectorXd& on_u, TimingState& state);

  Terms terms_of_mean(const TimingState& state);

  // What is said of the present, and what does not come.
  bool publish(const TimingState& state);
  bool find_published(const TimingState& state);
  bool take_so_far(const TimingState& state, Instant t, ContactSet& unsettled);
  // An event that may have happened unheard.
  struct Due {
    UncertainEvent event;
    bool beyond_doubt;
  };
  // What has been taken to have happened unheard: contacts of which nothing more is expected, those
  // that have closed, and how long the last event is ago at least [s].
  struct Unheard {
    ContactSet done = 0, closed = 0;
    double quiet_for = std::numeric_limits<double>::infinity();
  };
  Due next_due(const TimingState& state, const Motion& motion, const Unheard& unheard,
               ContactSet unsettled);
  ContactSet recently_reported(const TimingState& state, Instant t) const;
  bool would_stick(int contact, const Motion& motion);
  double exact_margin(int contact, const Motion& motion, const TimingState& state);
  void listen(Instant t, TimingState& state);
  bool is_suspect(const Motion& motion, const TimingState& state) const;
  bool is_overdue(const TimingState& state);
  Inconsistency overdue(const TimingState& state, Instant t);

  std::shared_ptr<Flows> flows_;
  double h_;
  double largest_w_ = 1.0;
  double energy_of_start_ = 0.0;
  bool is_homogeneous_ = false;
  double first_look_ = 0.0, longest_look_ = 0.0;  // at silence, after an instant [s]
  Uncertainty uncertainty_;
  sprag::State start_;
  TickedFlight flight_;
  std::vector<Functional> acceleration_;         // gamma_i' without contact forces
  Eigen::MatrixXd from_start_q_, from_start_u_;  // inverses of the uncertainty of a start
  Eigen::VectorXd start_gaps_, start_speeds_;    // its deviations, per contact
  std::vector<Covariance> covariances_;
  std::optional<UnknownTime> unknown_time_;  // where events jitter
  ImpactRecorder* recorder_ = nullptr;

  // Scratch of an instant.
  Belief now_;
  UncertainEvent event_;
  BeliefColumns columns_;
  ActiveImpact impact_;
  Eigen::VectorXd u_before_, before_impact_, u_sequence_, on_u_, on_flow_;
  Eigen::VectorXd share_, off_q_, off_u_;  // of a restart
  std::vector<Closing> closings_;
  // Sums over the closings of an instant: expected squares of the gap velocities before the impact,
  // and the squares of their means.
  double hit_speed2_ = 0.0, hit_mean2_ = 0.0;
  Eigen::VectorXd phi_;                // what a measurement sees of each column
  Eigen::MatrixXd Wt_, seen_of_gaps_;  // W^T; what the gaps see of each column
  Eigen::VectorXd no_gaps_;
  Motion sample_, published_, stuck_, hit_;
  // Of which state `now_` is what is published, whether it is more than the mean alone, and whether
  // an event had to have come by then.
  struct Published {
    const TimingState* state = nullptr;
    std::int64_t tick = 0, instants = 0;
    bool near = false, overdue = false;
  } last_published_;
};

}  // namespace sprag
