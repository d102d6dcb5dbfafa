// Recursive estimator of the state and the uncertain parameters of a machine from the times of its
// contact events.
//
// The belief is Gaussian (filter_belief.h). An event that is reported at t happened at t - tau,
// tau ~ N(0, sigma^2). Given tau everything is linear: the measurement g(t - tau) = 0 (where a
// contact closes) or lambda(t - tau) = 0 (where a contact opens), and the impact law.
//
// 1. Gauss-Newton steps on (xi, tau / sigma) find the most likely time, by
//      xi' <- phi (phi xi' - r) / (phi phi + n),
//    where r is the residual and n its rounding and second-order part. |xi'|^2 is the normalized
//    innovation squared.
// 2. Nodes around this time, spaced evenly, each hold the exact conditional belief: weight,
//    measurement update, flux of the gap velocity, impact, flight to the common time. One node
//    where times are exact.
// 3. One orthogonal factorization collapses the nodes to mean and covariance.
//
// Reports of one contact within 3 sigma of each other are a burst: the contact is held closed until
// it is reported closed, or nothing has come for 3 sigma. An impact while other contacts are held
// follows the impact law, which may release them.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/filter/linearized_flight.h"
#include "sprag/detail/filter/published_estimate.h"

namespace sprag {

/// Impulses of several contacts at once are decided, by the master too, up to this share of the
/// largest gap velocity, and positions are known up to this share of the largest terms of a gap.
inline constexpr double impulse_rounding = 1e-10, position_rounding = 2e-11;

class EventFilter {
 public:
  /// \param flight  must outlive the filter
  EventFilter(Flight& flight, FilterModel model);
  EventFilter(const EventFilter&) = delete;
  EventFilter& operator=(const EventFilter&) = delete;

  Eigen::Index n() const { return at_.n(); }
  Eigen::Index unknowns() const { return at_.unknowns(); }
  const FilterModel& model() const { return model_; }
  Flight& flight() const { return at_.flight(); }
  /// A belief of the right size, for copies that do not allocate.
  FilterBelief no_belief() const;

  /// Updates the belief by the events of one instant; belief.square and belief.innovation say how
  /// they fit. Does not allocate.
  /// \return false where no estimate follows; the belief is of no use then
  bool take(std::span<const ContactEvent> of_one_instant, FilterBelief& belief);
  /// The same for one event, linearized about the state and parameters of another belief, such as a
  /// smoothed one of a pass before; null: about the most likely ones given the events so far.
  bool take(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about = nullptr);

  /// Resets the state to x with the deviations S_x, 2n x 2n, at t, `closed` contacts being closed;
  /// the parameters keep what is known of them. Does not allocate.
  void restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
               const Eigen::Ref<const Eigen::MatrixXd>& S_x, ContactSet closed,
               FilterBelief& belief);

  /// Appends each step from now on to `steps`, which must outlive the filter; null: none. Allocates
  /// then.
  void record_in(std::vector<FilterStep>* steps);

  /// Ends the bursts after which no report has come for several sigma. Does not allocate.
  void expire(double t, FilterBelief& belief);
  /// When the first of them ends, if no report comes; +infinity without a burst [s].
  static double end_of_burst(const FilterBelief& belief);

  /// Whether a flight to t is affordable, and possible.
  bool can_reach(double t, const FilterBelief& belief) const {
    return flight().can_hold(belief.held, t - belief.t);
  }

  /// Whether the rule for bursts covers these events: no burst of one contact is within 3 sigma of
  /// a report of another one whose impulses change its gap velocity. Does not allocate.
  bool can_separate(std::span<const ContactEvent> events, const FilterBelief& belief);

  /// The published estimate at t (published_estimate.h): mean x, 2n entries. Valid until the next
  /// call.
  const Eigen::VectorXd& publish(double t, const FilterBelief& belief);
  /// The same without deviations, where event times are exact.
  const Eigen::VectorXd& publish_mean(double t, const FilterBelief& belief);
  /// The estimate at t as if no report were late, with its deviations.
  const Eigen::VectorXd& mean(double t, const FilterBelief& belief);
  /// After publish() or mean(): x there, 2n entries.
  const Eigen::VectorXd& estimate() const { return at_.x; }
  /// After publish() or mean(): 2n rows, columns of a square root of the covariance.
  const Eigen::MatrixXd& deviations() const { return at_.X; }
  /// Those of the parameters' coordinates, P rows, of the same columns.
  const Eigen::MatrixXd& parameter_deviations() const { return at_.T; }
  /// Rows of the gaps, m x columns of deviations(), after publish().
  void gap_deviations(const FilterBelief& belief, Eigen::Ref<Eigen::MatrixXd> of_gaps);
  /// After mean(): the force of a held contact, or a quantity with its zeros, and its row on the
  /// columns of deviations(). Valid until the next call.
  const Eigen::VectorXd& force_row(int contact, double t, Flight::Gap& force);
  /// Moves the flight of the mean to t.
  void fly_mean(double t, const FilterBelief& belief);
  /// After fly_mean() or mean(): a gap.
  double gap(int contact) const { return flight().gap(contact).g; }

  /// A contact's gap, its velocity and the gap's standard deviation at t.
  struct Crossing {
    double gap = 0.0, velocity = 0.0, deviation = 0.0;
  };
  Crossing crossing(int contact, double t, const FilterBelief& belief);

  /// The contact whose impact is certainly overdue at t, -1: none. Does not allocate.
  int overdue(double t, const FilterBelief& belief);

 private:
  enum class Kind { impact, stays, opens };
  // Where the event was: point of linearization before it, its time t - tau.
  struct Point {
    Eigen::VectorXd z;
    double tau = 0.0, spread = 0.0, square = 0.0;
    bool grazes = false;  // the gap velocity is not certain
  };
  struct Node {
    double tau = 0.0;  // the event was at t - tau
    double log_weight = 0.0;
    double gamma = 0.0, gamma_sigma = 0.0;  // gap velocity before the impact
    double after = 0.0, after_sigma = 0.0;  // and after it
    ContactSet held = 0;                    // after it
    Eigen::VectorXd z, jump, past_mean;
    Eigen::MatrixXd columns, past;
  };
  struct Event {
    int contact = 0;
    Kind kind = Kind::impact;
    double t = 0.0;
    double extra = 0.0;  // variance of the gap that is not of the belief
  };

  bool find(const Event& event, FilterBelief& belief);
  static bool precedes_last(const Event& event, double tau, const FilterBelief& belief);
  void scan(const Event& event, const FilterBelief& belief);
  bool expect(const Event& event, const FilterBelief& about, const FilterBelief& belief);
  bool update(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about);
  bool take_together(std::span<const ContactEvent> events, FilterBelief& belief);
  bool measure_together(double t, ContactSet closing, ContactSet staying, FilterBelief& belief);
  double variance_of_unreported(const Event& event);
  void note_touched(double t, int contact, FilterBelief& belief);
  bool condense(const Event& event, double reach, int nodes, FilterBelief& belief);
  void condition(const Event& event, const FilterBelief& belief, Node& node);
  double remainder(const Event& event);
  void measure_rest(const Event& event, double gamma);
  void weigh_flux(double sigma, double variance, double& gamma, Node& node);
  void collapse(double largest, int nodes, FilterBelief& belief);
  void describe(const Event& event, int nodes, FilterBelief& belief);
  void keep(Eigen::Index columns, FilterBelief& belief);
  bool burst(const Event& event, FilterBelief& belief);
  void close(const Event& event, FilterBelief& belief);
  Eigen::Index take_columns();
  void let_go(int contact, FilterBelief& belief);
  ContactSet released(int contact, const FilterBelief& belief) const;
  double energy(const Eigen::VectorXd& x) const;

  FilterModel model_;
  LinearizedFlight at_;
  PublishedEstimate published_;

  // Scratch.
  Point point_;
  Eigen::VectorXd xi_, next_, offset_, x_, c_, unit_, kick_;
  Eigen::VectorXd from_point_, c_by_c_, velocity_by_c_;
  double xi_tau_ = 0.0;
  std::vector<Node> nodes_;
  FilterBelief::Rows all_;  // of the belief, and of xi below
  std::vector<FilterStep>* steps_ = nullptr;
  Eigen::VectorXd past_mean_, reflector_;
};

}  // namespace sprag
