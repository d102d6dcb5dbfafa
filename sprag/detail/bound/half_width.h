// Half-widths from a bound on the error energy: for all errors with V <= B, |c^T q| <= sqrt(2 B c^T
// K^-1 c) and |c^T u| <= sqrt(2 B c^T M^-1 c).
#pragma once

#include <Eigen/Core>

#include "sprag/detail/bound/energy_metric.h"

namespace sprag {

/// Half-widths per sqrt B of the f coordinates and velocities, the m gaps and the model's outputs.
/// Infinite for a quantity that a rigid motion moves, because V does not contain that motion.
class HalfWidths {
 public:
  HalfWidths() = default;
  explicit HalfWidths(const EnergyMetric& metric);

  const Eigen::VectorXd& q() const { return q_; }
  const Eigen::VectorXd& u() const { return u_; }
  const Eigen::VectorXd& gaps() const { return gaps_; }
  const Eigen::VectorXd& outputs() const { return outputs_; }

 private:
  Eigen::VectorXd q_, u_, gaps_, outputs_;
};

/// factor sqrt(B), with 0 times infinity = 0.
double half_width(double factor, double bound);

}  // namespace sprag
