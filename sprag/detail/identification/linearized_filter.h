// A Kalman filter of what a machine is off from a fit to its impacts, and from its model: about a
// path with impacts at tau_k the machine's is, to first order, linear in the start, in the
// parameters, in how much later e_k each impact is and in what the model lacks between them,
//
//   0 = g_k + w^T xi_k + J_k dtheta + gamma_k- e_k,   e_k ~ N(t_k - tau_k, sigma^2),
//   xi_k+1 = Phi_k xi_k + (what e_k does) + w_k,      cov w_k = drift times the flight,
//
// t_k as measured. The path is the fit's own, or the one along the measured times, tau_k = t_k: the
// first is nearer to a machine that is its model, the second to one that drifts away from it.
// It begins without knowledge of xi and dtheta, so that its innovations nu_k, of variances s_k,
// give the restricted likelihood ln L = -1/2 sum (ln s_k + nu_k^2 / s_k).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/identification.h"

namespace sprag {

/// Whether a fit leaves so little that it is to the machine's values, which the filter is
/// linearized about.
bool is_near(const Identification& fit);
/// Whether what it leaves is rounding: the times are exact.
bool is_exact(const Identification& fit);

class LinearizedFilter {
 public:
  enum class About { fit, measured_times };
  LinearizedFilter(const Scene& scene, const Identification& fit, About about);

  /// One more parameter: d epsilon / d |gamma-| of all contacts, 0 at the usual speed.
  void add_restitution_trend();

  struct Value {
    double log = 0.0;     ///< ln L, of times
    double chi2 = 0.0;    ///< sum of nu_k^2 / s_k for base()
    double jitter = 0.0;  ///< as told, or the most likely [s]
    /// Parameters, in coordinates from the fit's, and their standard deviations for that jitter.
    Eigen::VectorXd parameters, sigmas;
    std::vector<double> innovations;  ///< nu_k / sqrt(s_k), up to a common factor
  };
  /// For a drift in units of unit(), and a restitution that scatters by this standard deviation
  /// from impact to impact.
  Value at(double ratio, double restitution_scatter = 0.0) const;
  /// Jitter that sigmas and ln L are computed with first: as told, or the fit's scatter [s].
  double base() const { return base_; }
  bool told() const { return told_; }
  /// Innovations that determine start and unknowns; those after them are white.
  int taken_up() const { return taken_up_; }
  /// Whether the path meets the supports near its times.
  bool meets_the_supports() const;
  /// The drift that moves gaps in a usual flight as far as this jitter does.
  double unit(double jitter) const { return unit_ * jitter * jitter; }

 private:
  Eigen::Index parameters() const { return J_.empty() ? 0 : J_.front().cols(); }
  struct Estimate;
  void fly(std::size_t s, std::size_t k, double per_root, Estimate& of) const;
  void hear(std::size_t s, std::size_t k, double restitution_scatter, Estimate& of) const;
  void set_parameter_columns(const Identification& fit, const Eigen::VectorXd& values);
  void set_drift(const Scene& fitted);

  MachineFamily family_;
  const Stretches& stretches_;  // the path
  const Stretches& measured_;
  const std::vector<Eigen::VectorXd>& speeds_;  // gamma- of the fit
  Machine machine_;
  Flights flights_;
  std::vector<Path> paths_;
  std::vector<Eigen::MatrixXd> J_;     // a stretch: its impacts x P
  Eigen::MatrixXd drift_y_, drift_u_;  // of drift 1
  double base_ = 0.0;                  // jitter that it is computed for [s]
  bool told_ = false;
  double unit_ = 0.0;
  double speed_ = 0.0, interval_ = 0.0;  // usual ones
  int taken_up_ = 0;                     // innovations that determine the unknowns
};

}  // namespace sprag
