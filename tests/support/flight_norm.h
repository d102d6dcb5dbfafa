// The norm |exp(A tau)|^2 of free flight in the energy norm, from the flow's own matrix, column by
// column: the reference for its bounds. Each call takes a singular value decomposition.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag {

class FlightNorm {
 public:
  /// `flows` must outlive this. If K has a null space, energy and flight do not depend on the
  /// position within it.
  explicit FlightNorm(const Flows& flows);

  double square(double tau) const;

 private:
  const Flow* free_;
  Eigen::VectorXd omega_, inverse_;  // of the natural modes, both 0 for rigid-body modes
  Eigen::MatrixXd to_q_, from_q_;    // from and to modes of mass 1
};

}  // namespace sprag
