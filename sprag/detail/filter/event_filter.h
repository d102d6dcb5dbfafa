// Recursive Bayesian estimator of the state and the uncertain parameters of a machine from the
// times of its contact events (docs/explanation/filter.md).
//
// The belief is Gaussian (filter_belief.h). An event that is reported at t happened at t - tau, tau
// ~ N(0, sigma^2). Given tau the model is linear: the measurement is g(t - tau) = 0 for a closing,
// lambda(t - tau) = 0 for an opening; the impact is a linear map of the state.
//
// 1. Gauss-Newton steps on (xi, tau / sigma) find the most likely event time, by
//      xi' <- phi (phi xi' - r) / (phi phi + n),
//    where r is the residual and n the variance of its rounding and second-order part. |xi'|^2 is
//    the normalized innovation squared.
// 2. Evenly spaced nodes around this time form a Gaussian sum (Alspach & Sorenson 1972). Each node
//    has a weight and the belief given its event time: measurement update, flux of the gap
//    velocity, impact, flight to the common time. Exact event times need one node.
// 3. Moment matching collapses the sum to one Gaussian, by one orthogonal factorization.
//
// Reports of one contact within 3 sigma of each other are a burst, unless the belief itself places
// the events farther apart. The filter holds the contact closed over a burst, until a report of a
// sustained closing or for 3 sigma after the last report. An impact while other contacts are held
// follows the impact law, which may release them.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/filter/linearized_flight.h"
#include "sprag/detail/filter/published_estimate.h"

namespace sprag {

/// Relative accuracies on machines with several contacts. The impact law, also the master's,
/// resolves impulses to this share of the largest gap velocity, and positions to this share of the
/// largest sum of absolute terms of a gap. With exact times an innovation below this share of these
/// terms is rounding.
inline constexpr double contact_rounding = 1e-10;

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
  /// A zero belief of the filter's sizes. Copies to and from it do not allocate.
  FilterBelief no_belief() const;

  /// Updates the belief by the events of one instant. belief.square is their largest normalized
  /// innovation squared, belief.innovation that of the last closing. Does not allocate.
  /// \return false if no estimate exists; the belief is then undefined
  bool take(std::span<const ContactEvent> of_one_instant, FilterBelief& belief);
  /// The same for one event. `about`: the belief to linearize about, such as the smoothed one of
  /// the previous pass; null: the most likely state and parameters given the events so far.
  bool take(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about = nullptr);

  /// Resets the state to x with the square root S_x of its covariance, 2n x 2n, at t, with the
  /// contacts `closed`. The marginal distribution of the parameters is kept. Does not allocate.
  void restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
               const Eigen::Ref<const Eigen::MatrixXd>& S_x, ContactSet closed,
               FilterBelief& belief);

  /// Appends each later step to `steps`, which must outlive the filter; null: stops. Recording
  /// allocates.
  void record_in(std::vector<FilterStep>* steps);

  /// Ends the bursts whose last report is 3 sigma or more before t. Does not allocate.
  void expire(double t, FilterBelief& belief);
  /// Time at which the first burst ends if no report comes; +infinity without a burst [s].
  static double end_of_burst(const FilterBelief& belief);

  /// Whether the rule for bursts covers these events: no burst of one contact is within 3 sigma of
  /// a report of another contact whose impulses change its gap velocity. Does not allocate.
  bool can_separate(std::span<const ContactEvent> events, const FilterBelief& belief);

  /// Computes the published estimate at t (published_estimate.h) and returns its mean x, 2n
  /// entries. Valid until the next call.
  const Eigen::VectorXd& publish(double t, const FilterBelief& belief);
  /// The same; with exact event times it computes no deviations.
  const Eigen::VectorXd& publish_mean(double t, const FilterBelief& belief);
  /// After publish(): whether its deviations hold (PublishedEstimate::is_determined()).
  bool is_determined() const { return published_.is_determined(); }
  /// The estimate at t with its deviations, without the mixture over unreported events.
  const Eigen::VectorXd& mean(double t, const FilterBelief& belief);
  /// After publish() or mean(): x there, 2n entries.
  const Eigen::VectorXd& estimate() const { return at_.x; }
  /// After publish() or mean(): square root of the covariance of x, 2n rows.
  const Eigen::MatrixXd& deviations() const { return at_.X; }
  /// The rows of the parameters' coordinates in the same square root, P rows.
  const Eigen::MatrixXd& parameter_deviations() const { return at_.T; }
  /// After publish(): square root of the gaps' covariance, m x columns of deviations().
  void gap_deviations(const FilterBelief& belief, Eigen::Ref<Eigen::MatrixXd> of_gaps);
  /// After mean(): the force of a held contact, or a quantity with its zeros, and its derivative
  /// along the columns of deviations(). Valid until the next call.
  const Eigen::VectorXd& force_row(int contact, double t, Flight::Gap& force);
  /// Moves the mean to t, without its deviations.
  void fly_mean(double t, const FilterBelief& belief);
  /// After fly_mean() or mean(): the gap of a contact.
  double gap(int contact) const { return flight().gap(contact).g; }

  /// A contact's gap, its velocity and the gap's standard deviation at t.
  struct Crossing {
    double gap = 0.0, velocity = 0.0, deviation = 0.0;
  };
  Crossing crossing(int contact, double t, const FilterBelief& belief);

  /// Contact whose event is overdue at t beyond doubt, -1: none. Does not allocate.
  int overdue(double t, const FilterBelief& belief);
  /// After overdue(t): time before which no gap of the mean becomes negative, as far as a search of
  /// bounded cost shows; t where a contact is held or a gap is not positive. Does not allocate.
  double open_until(double t, const FilterBelief& belief);

 private:
  enum class Kind { impact, stays, opens };
  // Most likely event: state and parameters to linearize about, at the belief's time; the event is
  // at t - tau. `spread` is the deviation of tau, `square` the normalized innovation squared.
  struct Point {
    Eigen::VectorXd z;
    double tau = 0.0, spread = 0.0, square = 0.0;
    bool grazes = false;  // set by find() if the sign of the gap velocity, or of the rate of the
                          // force, is uncertain
  };
  struct Node {
    double tau = 0.0;  // the event of this hypothesis is at t - tau
    double log_weight = 0.0;
    double gamma = 0.0, gamma_sigma = 0.0;  // gap velocity before the impact
    double after = 0.0, after_sigma = 0.0;  // and after it
    double departs = 0.0;  // square of a positive gap velocity before the impact, in deviations
    ContactSet held = 0;   // after it
    Eigen::VectorXd z, jump, past_mean;
    Eigen::MatrixXd columns, past;
  };
  struct Event {
    int contact = 0;
    Kind kind = Kind::impact;
    double t = 0.0;
    double extra = 0.0;  // variance of the gap besides that of the belief
  };

  // Evenly spaced nodes, and their weights.
  struct Placement {
    double center = 0.0, reach = 0.0;
    double largest = 0.0;  // log weight; not finite: there is no estimate
    double total = 0.0;    // sum of all weights, over the largest one
    int heaviest = 0;      // node of the largest weight
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
  Placement place(const Event& event, double center, double reach, int nodes,
                  const FilterBelief& belief);
  bool condense(const Event& event, double reach, int nodes, FilterBelief& belief);
  void condition(const Event& event, const FilterBelief& belief, Node& node);
  double remainder(const Event& event);
  void measure_rest(const Event& event, double gamma);
  void weigh_flux(double sigma, double variance, double& gamma, Node& node);
  void collapse(double largest, int nodes, FilterBelief& belief);
  void describe(const Event& event, int nodes, FilterBelief& belief);
  void keep(Eigen::Index columns, FilterBelief& belief);
  bool resolves(const Event& event, FilterBelief& belief);
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
  FilterBelief::Rows all_;  // columns of the belief, and of xi in the rows below
  std::vector<FilterStep>* steps_ = nullptr;
  Eigen::VectorXd past_mean_, reflector_;
};

}  // namespace sprag
