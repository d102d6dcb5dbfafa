// Recursive estimator of the state and the uncertain parameters of a machine from the times of its
// contact events.
//
// The belief is Gaussian, (y, y', c) = z + S xi with xi ~ N(0, I): the modal state
// (machine_family.h) and the coordinates c of the parameters. An event that is reported at t
// happened at t - tau, tau ~ N(0, sigma^2). Given tau everything is linear: the measurement g(t -
// tau) = 0 (where a contact closes) or lambda(t - tau) = 0 (where a contact opens), and the impact
// law.
//
// 1. Gauss-Newton steps on (xi, tau / sigma) find the most likely time, by
//      xi' <- phi (phi xi' - r) / (phi phi + n),
//    where r is the residual and n its rounding and second-order part. |xi'|^2 is the normalized
//    innovation squared.
// 2. Nodes around this time, spaced evenly, each hold the exact conditional belief: weight,
//    measurement update (Potter), flux of the gap velocity, impact, flight to the common time.
// 3. One orthogonal factorization collapses the nodes to mean and covariance.
//
// Second order in the parameters: each flight adds the columns sigma_k (dE / dc_k) S, the product
// of the deviations of state and parameter. Considered parameters (Schmidt) keep mean and variance;
// they enter the gain of everything else.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/adaptation/joint_flight.h"
#include "sprag/estimation/innovation.h"
#include "sprag/identification/maximum_likelihood.h"
#include "sprag/mechanics/contact_event.h"

namespace sprag {

/// What the filter knows after its last event. A value: copies between beliefs of one filter do not
/// allocate. n modes, P parameters, m contacts.
struct FilterBelief {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  double t = 0.0;         ///< the belief is that of this time [s]
  int held = -1;          ///< the contact that is closed since then, -1: none
  bool burst = false;     ///< reports of `held` are too close for an estimate of single impacts
  Eigen::VectorXd z;      ///< mean of (y, y', c), 2n + P entries
  Rows S;                 ///< square root of the covariance, square
  double sigma = 0.0;     ///< standard deviation of event times [s]
  Innovation innovation;  ///< of the last closing
  double square = 0.0;    ///< normalized innovation squared of the last event
  double length = 0.0;    ///< largest terms of a gap so far
  Eigen::VectorXd
      reported;  ///< per contact: time of its last report, -infinity before the first [s]
  Eigen::VectorXd occurred;  ///< per contact: estimated time of its last event [s]
  Eigen::VectorXd speed;     ///< per contact: of the gap after its last impact; 0: none
  // The last impact, for ticks that may precede it.
  double impact_time = 0.0, impact_sigma = 0.0;         ///< [s]; sigma 0: not uncertain
  double speed_before = 0.0, speed_before_sigma = 0.0;  ///< gap velocity before it [m/s]
  double speed_after = 0.0, speed_after_sigma = 0.0;    ///< and after it
  Eigen::VectorXd jump;                                 ///< its change of (y, y'), 2n entries
};

/// One step of the filter for a smoother. With z + S xi before it and z' + S' eta after it, given
/// the event, xi = mean + on_next eta + rest zeta with eta, zeta ~ N(0, I).
/// No inverse of a covariance occurs, and no entry exceeds 1.
struct FilterStep {
  FilterBelief after;                ///< z', S'
  int contact = -1;                  ///< whose event it is
  Eigen::VectorXd mean;              ///< 2n + P entries
  FilterBelief::Rows on_next, rest;  ///< square
};

/// What is not deterministic about machine and parameters.
struct FilterModel {
  /// Standard deviation of the random walk of each parameter's coordinate after a unit of time, P
  /// entries.
  Eigen::VectorXd walk;
  /// Root of the covariance of the process noise in (y, y') per unit of time, 2n rows; or empty.
  Eigen::MatrixXd drift = {};
  /// Of each parameter whether it is only considered; empty: none is.
  std::vector<bool> considered = {};
};

class EventFilter {
 public:
  /// \param family  modal machine family; must outlive the filter
  EventFilter(const MachineFamily& family, FilterModel model);

  Eigen::Index n() const { return flight_.n(); }
  Eigen::Index unknowns() const { return flight_.unknowns(); }
  const FilterModel& model() const { return model_; }
  /// A belief of the right size, for copies that do not allocate.
  FilterBelief no_belief() const;

  /// Updates the belief by an event; belief.square and belief.innovation say how it fits. Does not
  /// allocate.
  /// \param about  linearize about the state and parameters of this belief, such as a smoothed one
  ///   from a pass before, in place of the most likely ones given the events so far; null: no
  /// \return false where no estimate follows; the belief is of no use then
  bool take(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about = nullptr);

  /// Follows a path of known event times (maximum_likelihood.h) from its start, every step
  /// linearized about the path. `belief` is that after its last impact. Allocates.
  void follow(const Likelihood& path, const Stretches& measured, double sigma,
              FilterBelief& belief);

  /// Resets the state to x with the deviations S_x, 2n x 2n, at t; the parameters keep what is
  /// known of them. Does not allocate.
  void restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
               const Eigen::Ref<const Eigen::MatrixXd>& S_x, FilterBelief& belief);

  /// Appends each step from now on to `steps`, which must outlive the filter; null: none. Allocates
  /// then.
  void record_in(std::vector<FilterStep>* steps);

  /// Ends a burst after which no report has come for several sigma. Does not allocate.
  void expire(double t, FilterBelief& belief);

  /// Steps of a flight to t, as of one with no contact held; many where a contact is held long.
  double cost(double t, const FilterBelief& belief) const;

  /// The published estimate at t: mean (y, y'), 2n entries, which weighs whether the last reported
  /// impact, or one that has not been reported yet, lies before t. Valid until the next call.
  const Eigen::VectorXd& publish(double t, const FilterBelief& belief);
  /// The estimate at t as if no report were late, with its deviations.
  const Eigen::VectorXd& mean(double t, const FilterBelief& belief);
  /// Its deviations: 2n rows, columns of a square root of the covariance. Valid as publish().
  Eigen::Ref<const Eigen::MatrixXd> deviations() const { return at_.X.leftCols(published_); }
  /// Those of the parameters' coordinates, P rows, of the same columns.
  Eigen::Ref<const Eigen::MatrixXd> parameter_deviations() const {
    return at_.T.leftCols(published_);
  }
  /// Rows of the gaps, m x columns of deviations(), after publish(); and a gap's mean.
  void gap_deviations(const FilterBelief& belief, Eigen::Ref<Eigen::MatrixXd> of_gaps);
  double gap(int contact) const { return flight_.gap(contact).g; }

  /// A contact's gap, its velocity and the gap's standard deviation at t.
  struct Crossing {
    double gap = 0.0, velocity = 0.0, deviation = 0.0;
  };
  Crossing crossing(int contact, double t, const FilterBelief& belief);

  /// The contact whose impact is certainly overdue at t, -1: none. Does not allocate.
  int overdue(double t, const FilterBelief& belief);

  /// Columns of deviations(), at most.
  Eigen::Index most_columns() const { return at_.X.cols(); }

 private:
  // Everything that is linear about one time.
  struct Linearized {
    Eigen::VectorXd x;                // (y, y') at the point of linearization
    Eigen::MatrixXd X;                // columns of (y, y'), 2n rows
    Eigen::MatrixXd T;                // columns of c, P rows
    Eigen::MatrixXd past;             // columns of xi, where steps are recorded
    JointFlight::Gap of;              // gap or force
    Eigen::VectorXd phi;              // what it sees of each column
    Eigen::VectorXd psi;              // and its rate
    Eigen::VectorXd by_c, rate_by_c;  // partial derivatives, P entries
    double noise = 0.0;               // rounding, a variance
  };
  // Where the event was: point of linearization before it, its time t - tau.
  struct Point {
    Eigen::VectorXd z;
    double tau = 0.0, spread = 0.0, square = 0.0;
  };
  struct Node {
    double log_weight = 0.0, gamma = 0.0, gamma_sigma = 0.0;
    double after = 0.0, after_sigma = 0.0;  // gap velocity after the impact
    Eigen::VectorXd z, past_mean;
    Eigen::MatrixXd columns, past;
  };
  enum class Kind { impact, stays, opens };

  Eigen::Index size() const { return 2 * n() + unknowns(); }
  void spread(const FilterBelief& belief, double duration);
  void linearize(double t, const Eigen::VectorXd& z, const FilterBelief& belief,
                 bool second_order = true);
  void take_linearized(int contact, double t, Point& on, FilterBelief& belief);
  void look(int contact, bool of_force, double t);
  bool find(int contact, Kind kind, double t, FilterBelief& belief, Point& point);
  void scan(int contact, double t, const FilterBelief& belief);
  bool update(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about);
  bool expect(int contact, Kind kind, double t, const FilterBelief& about,
              const FilterBelief& belief, Point& point);
  bool condense(int contact, Kind kind, double t, const Point& point, double reach, double extra,
                int nodes, FilterBelief& belief);
  void condition(int contact, Kind kind, double t, double tau, const Point& point, double extra,
                 const FilterBelief& belief, Node& node);
  void see_velocity(int contact, Node& node);
  void carry(const Eigen::Ref<const Eigen::VectorXd>& dz);
  void update_along(const Eigen::VectorXd& direction, double shift, double share,
                    Eigen::VectorXd& x, Eigen::VectorXd& c);
  void measure(double residual, double noise, Eigen::VectorXd& x, Eigen::VectorXd& c);
  void weigh_flux(double sigma, double variance, double& gamma, Node& node, Eigen::VectorXd& x,
                  Eigen::VectorXd& c);
  void collapse(double weights, int nodes, FilterBelief& belief);
  bool burst(int contact, bool stays, double t, FilterBelief& belief);
  void let_go(FilterBelief& belief);
  bool mix_impact(int contact, double t, const FilterBelief& belief);
  void triangularize(FilterBelief::Rows& A, Eigen::Index first, Eigen::Index end,
                     Eigen::Index columns);
  void keep(Eigen::Index columns, FilterBelief& belief);
  std::vector<double> largest(const Likelihood& path, const Eigen::VectorXd& c);
  Eigen::VectorXd start_of(const Likelihood& path, std::size_t s) const;

  const MachineFamily* family_;
  FilterModel model_;
  bool considers_ = false;
  std::vector<Eigen::Index> flow_unknowns_;
  JointFlight flight_, onward_;

  // Scratch.
  Eigen::MatrixXd A_;  // z by columns, before the event: those of S, of the walk, of the drift
  Linearized at_;
  Eigen::Index published_ = 0;
  Eigen::VectorXd xi_, next_, gain_, dx_, direction_, offset_, c_, x_, unit_;
  Eigen::VectorXd c_by_c_, rate_by_c_;
  double xi_tau_ = 0.0;
  std::vector<Node> nodes_;
  FilterBelief::Rows all_;  // of the belief, and of xi below
  std::vector<FilterStep>* steps_ = nullptr;
  Eigen::VectorXd past_mean_, past_gain_;
  Eigen::VectorXd reflector_;
  Point point_;
};

}  // namespace sprag
