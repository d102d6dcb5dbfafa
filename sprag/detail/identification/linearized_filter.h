// Kalman filter of the deviation of a machine from a fit to its impacts. About a path with impacts
// at tau_k the machine's path is, to first order, linear in the start, the parameters theta, the
// delay e_k of each impact, and the process noise:
//
//   0 = g_k + w^T xi_k + J_k dtheta + gamma_k- e_k,   e_k ~ N(t_k - tau_k, sigma^2),
//   xi_k+1 = Phi_k xi_k + (effect of e_k) + w_k,      cov w_k = drift times the flight,
//
// with the measured times t_k. The path is the fit's, or the path along the measured times (tau_k
// equal to t_k). The first is nearer to a machine without model mismatch, the second to one that
// drifts away from the model. The prior of xi and dtheta is diffuse, so the innovations nu_k with
// variances s_k give the restricted likelihood (Patterson & Thompson 1971), ln L = -1/2 sum (ln s_k
// + nu_k^2 / s_k).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/identification.h"

namespace sprag {

/// Whether the residuals of a fit are small enough to linearize about its values.
bool is_near(const Identification& fit);
/// Whether the residuals are rounding: the times are exact.
bool is_exact(const Identification& fit);

class LinearizedFilter {
 public:
  enum class About { fit, measured_times };
  LinearizedFilter(const Scene& scene, const Identification& fit, About about);

  /// Adds one parameter: d epsilon / d |gamma-| of all contacts, with no effect at the usual speed.
  void add_restitution_trend();

  struct Value {
    double log = 0.0;     ///< ln L of the event times
    double chi2 = 0.0;    ///< sum of nu_k^2 / s_k for base()
    double jitter = 0.0;  ///< as specified, or the most likely [s]
    /// Deviations of the parameters from the fit in coordinates, and their standard deviations for
    /// that jitter.
    Eigen::VectorXd parameters, sigmas;
    std::vector<double> innovations;  ///< nu_k / sqrt(s_k), up to a common factor
  };
  /// Evaluates the filter for a drift in units of unit() and for a restitution with this standard
  /// deviation from impact to impact.
  Value at(double ratio, double restitution_scatter = 0.0) const;
  /// Jitter of the filter's run: as specified, or the fit's scatter [s]. An unspecified jitter is
  /// then estimated by scaling.
  double base() const { return base_; }
  bool jitter_given() const { return jitter_given_; }
  /// Number of leading innovations that determine start and unknowns. Those after them are white if
  /// the model is right.
  int taken_up() const { return taken_up_; }
  /// Whether the gaps of the path at its times are near zero.
  bool meets_the_supports() const;
  /// The drift that moves gaps in a usual flight by as much as this jitter.
  double unit(double jitter) const { return unit_ * jitter * jitter; }

 private:
  Eigen::Index parameters() const { return J_.empty() ? 0 : J_.front().cols(); }
  struct Estimate;
  void fly(std::size_t s, std::size_t k, double per_root, Estimate& of) const;
  void update(std::size_t s, std::size_t k, double restitution_scatter, Estimate& of) const;
  void set_parameter_columns(const Identification& fit, const Eigen::VectorXd& values);
  void set_drift(const Scene& fitted);

  MachineFamily family_;
  const Stretches& stretches_;  // the path
  const Stretches& measured_;
  const std::vector<Eigen::VectorXd>& speeds_;  // gamma- of the fit
  Machine machine_;
  Flights flights_;
  std::vector<Path> paths_;
  std::vector<Eigen::MatrixXd> J_;     // of each stretch: its impacts x P
  Eigen::MatrixXd drift_y_, drift_u_;  // square root of the process noise at drift 1
  double base_ = 0.0;                  // see base() [s]
  bool jitter_given_ = false;
  double unit_ = 0.0;
  double speed_ = 0.0, interval_ = 0.0;  // usual speed and interval
  int taken_up_ = 0;                     // see taken_up()
};

}  // namespace sprag
