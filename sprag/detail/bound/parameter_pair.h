// A constant factor on K or C at both ends of its tolerance: two motions x+ and x- in free flight
// that start at the replica's state x_s and have its impacts. With B the tolerated change of the
// machine's matrix A, xi = (x+ - x-) / 2 and m = (x+ + x-) / 2 - x_s,
//
//   xi' = A xi + B (x_s + m),   m' = A m + B xi,
//
// so that a machine with the factor theta, |theta| <= 1, moves along x_s + theta xi up to
// second-order terms in the tolerance.
#pragma once

#include <array>
#include <memory>

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag {

enum class ToleratedFactor { stiffness, damping };

/// Difference of two motions in free flight, modal coordinates, f entries each.
struct MotionDifference {
  Eigen::VectorXd z, v, acceleration, jerk;

  void resize(Eigen::Index f);
};
/// |x| and |x''| in the energy norm.
double length(const EnergyMetric& metric, const MotionDifference& x);
double second_rate(const EnergyMetric& metric, const MotionDifference& x);

class ParameterPair {
 public:
  /// \param limit tolerance of the factor, > 0. `metric` must outlive this. Throws ModelError.
  ParameterPair(const EnergyMetric& metric, ToleratedFactor factor, double limit);

  /// Upper bound on |B| [1/s].
  double rate() const { return rate_; }

  /// Puts both motions at (q, u), f entries each, at t [s].
  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& u, double t);
  /// Computes xi and m at t, not before the last start or impact. \param replica state of the
  /// replica at t.
  void look(double t, const ModalState& replica);
  /// Applies an impact of one contact to both motions at time t, for any gap velocities.
  void impact(int contact, double epsilon, double t);

  const MotionDifference& xi() const { return xi_; }
  const MotionDifference& m() const { return m_; }
  /// |B x| of a difference, energy norm. Does not allocate.
  double defect(const MotionDifference& x);

 private:
  void change(const Eigen::VectorXd& of_z, const Eigen::VectorXd& of_v, Eigen::VectorXd& out) const;

  const EnergyMetric* metric_;
  ToleratedFactor factor_;
  double limit_, rate_;
  std::array<std::unique_ptr<Flows>, 2> flows_;  // for the upper and the lower limit
  std::array<Motion, 2> motion_, moved_;
  MotionDifference xi_, m_;
  Eigen::VectorXd q_, u_, z_, v_, scratch_;
  const Eigen::VectorXd no_gaps_;
};

}  // namespace sprag
