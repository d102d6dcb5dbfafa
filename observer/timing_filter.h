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
// An event time that is off by tau ~ N(0, sigma^2) is one more unknown of its instant: at the
// reported time g_i- = gamma_i- tau, and the impact was tau earlier, which moves q by (u+ - u-)
// tau, and u by what gamma_i- and the damping forces were otherwise meanwhile. Only the product
// gamma_i- tau is not linear; gamma_i- is taken from the estimate, and what that lacks is added to
// the noise.
//
// Which contacts take an impulse is not always known: where several close at one instant, or others
// are closed or open at it. There the impact law decides on the mean, and what it would have been
// otherwise widens the covariance.
//
// The covariance is kept as P = S S^T, propagated column by column and conditioned by Potter's
// square root for scalar measurements, so that it cannot turn indefinite and stays accurate
// relative to the smallest of its axes, with exact measurements too. Columns that events add are
// merged by Householder reflections. Covariances belong to instants with events; states share them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "mechanics/confidence.h"
#include "mechanics/contact_event.h"
#include "mechanics/flow.h"
#include "mechanics/impact_law.h"
#include "mechanics/innovation.h"
#include "mechanics/ticked_flight.h"
#include "observer/uncertainty.h"

namespace sprag {

/// How the innovations of a filter fit what it holds possible: squares over their variances, which
/// are 1 in the mean where model, events and uncertainty are right.
struct Consistency {
  std::int64_t count = 0;  ///< innovations since the start
  double mean = 1.0;       ///< over about the last 16, weights falling exponentially
  double largest = 0.0;    ///< at the last instant with events
};

/// Everything that changes, at tick `tick`. Copies between states of one filter do not allocate.
struct TimingState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  ContactSet inside = 0;  ///< closed since t = 0: the machine may have started inside the support
  Motion motion;          ///< of the mean; in free flight its t is that of the anchor
  TickedFlight::Anchor anchor;
  Instant covariance_time;    ///< the instant to which covariance number `instants` belongs
  std::int64_t instants = 0;  ///< instants with events since the start
  Redundancy redundancy;
  std::int64_t refused_impacts = 0;    ///< sets of closed contacts without a flow
  std::int64_t ambiguous_impacts = 0;  ///< decided by the mean
  std::int64_t lost = 0;               ///< how often it was no longer a number and began again
  Innovation innovation;
  Consistency consistency;
  double length = 0.0, speed = 0.0;  ///< largest terms of gaps and of their velocities so far
};

class TimingFilter {
 public:
  using State = TimingState;

  /// Tick h > 0. Keeps the covariances of the last 1024 instants with events, fewer of large
  /// machines (64 MiB in all), so that a time line can go back behind as many; further back it
  /// would start from the uncertainty of a start. Throws ModelError.
  TimingFilter(Model model, double h, Uncertainty uncertainty);
  /// The same with flows that others use as well.
  TimingFilter(std::shared_ptr<Flows> flows, double h, Uncertainty uncertainty);
  TimingFilter(const TimingFilter&) = delete;
  TimingFilter& operator=(const TimingFilter&) = delete;

  /// Puts the mean at (q, u) with chi at tick k, with the uncertainty of a start. May allocate.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, TimingState& state);

  /// Puts the mean at (q, u), f entries each, at the present tick. Mode by mode, its covariance is
  /// that of a start, less as far as the filter, had it heard of no event since instant number
  /// `believed`, would have been both sure and close to (q, u).
  void restart(const Eigen::Ref<const Eigen::VectorXd>& q,
               const Eigen::Ref<const Eigen::VectorXd>& u, std::int64_t believed,
               TimingState& state);

  /// As Replica's. They do not allocate once the locked sets that occur have been met.
  void tick(std::span<const ContactEvent> events, TimingState& state);
  void apply(std::span<const ContactEvent> events, TimingState& state);

  /// Moves the mean from the last instant with events, or the start, to the instant of these, and
  /// applies them. For who needs no ticks: the tick does not count on, and outputs are of no use.
  void follow(std::span<const ContactEvent> events, TimingState& state);

  /// The mean at the present tick, f entries each.
  void output(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  /// Standard deviations of q and u, f entries each, and of the gaps of all contacts, at the
  /// present tick.
  void deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                  Eigen::Ref<Eigen::VectorXd> u, Eigen::Ref<Eigen::VectorXd> gap);

  /// Of a contact's gap between the last two instants with events: the share of the time in which
  /// it was negative, and its smallest value [m].
  struct LastFlight {
    double inside = 0.0;
    double lowest = 0.0;
  };
  LastFlight last_flight(int contact, const TimingState& state);

  /// Covariance of (q, u) at the present tick, 2 f x 2 f. Allocates.
  Eigen::MatrixXd covariance(const TimingState& state);

  double h() const { return h_; }
  const Flows& flows() const { return *flows_; }
  Flows& flows() { return *flows_; }

 private:
  // A measurement whose deviation is below this share of its terms tells nothing but their
  // rounding.
  static constexpr double rounding = 32.0 * std::numeric_limits<double>::epsilon();

  struct Covariance {
    std::int64_t instants = -1;  // another number than a state's: it is gone
    Eigen::Index columns = 0;
    Eigen::MatrixXd q, u;  // S, f rows each
    Motion mean;           // as it goes on from there
  };
  struct Closing {
    int contact;
    double epsilon;
    double gamma, gamma_rate, gamma_second_rate;  // before the impact
  };

  Covariance& slot(std::int64_t instants) {
    return covariances_[static_cast<std::size_t>(instants %
                                                 static_cast<std::int64_t>(covariances_.size()))];
  }
  Eigen::Index f() const { return flows_->dynamics().coordinates(); }
  void set_start(Covariance& S) const;
  void go_on(TimingState& state);
  void add_drift(double tau);
  void load(const TimingState& state, Instant t);
  void load(const Covariance& from, Instant t);
  void move(const Flow& flow, double tau);
  void enter(ContactSet locked, Instant t, TimingState& state);
  void apply_group(std::span<const ContactEvent> events, TimingState& state);
  bool is_sane() const;
  void begin_again(TimingState& state);
  void drop_redundant(ContactSet held, TimingState& state);
  void measure_release(int contact, TimingState& state);
  void measure_closings(TimingState& state);
  double condition(double residual, double noise, double scale, Consistency& consistency);
  void reset(ContactSet staying, ContactSet leaving, TimingState& state);
  void decide(ContactSet staying, ContactSet leaving, TimingState& state);
  std::vector<Closing>::iterator find_closing(int contact);
  void add_event_unknowns();
  void add_effect(Eigen::Index row, const Eigen::VectorXd& on_q, const Eigen::VectorXd& on_u);
  void merge_columns();

  std::shared_ptr<Flows> flows_;
  double h_;
  double largest_w_ = 1.0;
  Uncertainty uncertainty_;
  sprag::State start_;
  TickedFlight flight_;
  std::vector<Functional> acceleration_;  // gamma_i' without contact forces
  Eigen::MatrixXd MinvC_, MinvK_;
  Eigen::MatrixXd from_start_q_, from_start_u_;  // inverses of the uncertainty of a start
  std::vector<Covariance> covariances_;

  // Scratch of an instant.
  Eigen::VectorXd q_, u_, u_before_;
  Eigen::VectorXd jump_, first_on_q_, first_on_u_, on_q_, on_u_;
  Covariance now_;
  Eigen::MatrixXd event_;  // rows of S of the event's own unknowns, and their means: tau, tau^2,
  Eigen::VectorXd event_mean_;  // tau times what is not known of each gamma- and of its rate
  std::vector<Closing> closings_;
  Eigen::VectorXd phi_;         // what a measurement sees of each column
  Eigen::MatrixXd z_, v_;       // S in a flow's oscillators
  Eigen::MatrixXd directions_;  // f x m: u+ - u- for a unit impulse of each closing
  OscillatorState unit_z_, unit_v_, from_z_, from_v_;
  Eigen::ArrayXd no_alpha_;
  Eigen::VectorXd no_gaps_;
  Eigen::MatrixXd merged_;  // columns x 2 f
  Motion sample_;
};

}  // namespace sprag
