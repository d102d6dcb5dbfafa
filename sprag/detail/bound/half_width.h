// A bound on the error energy as lengths: of all errors with V <= B, a linear functional c^T q of
// the displacements is at most sqrt(2 B c^T K^-1 c), and c^T u of the velocities sqrt(2 B c^T M^-1
// c).
#pragma once

#include <Eigen/Core>

#include "sprag/detail/bound/energy_metric.h"

namespace sprag {

/// Half-widths per sqrt B of the f coordinates, the m gaps and the model's outputs. Infinite where
/// a rigid motion, which V does not contain, moves the quantity.
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

/// factor sqrt(B) with 0 times infinity 0 and infinity where either is not known.
double half_width(double factor, double bound);

}  // namespace sprag
