// |exp(A tau)|^2 of free flight in the energy norm, from the flow's own matrix, column by column:
// what the bounds on it are held against. Takes a singular value decomposition each time.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag {

class FlightNorm {
 public:
  /// `flows` must outlive this. Where K has a null space the energy does not see where the machine
  /// is in it, and the flight does not depend on it.
  explicit FlightNorm(const Flows& flows);

  double square(double tau) const;

 private:
  const Flow* free_;
  Eigen::VectorXd omega_, inverse_;  // of the natural modes, 0 both where rigid
  Eigen::MatrixXd to_q_, from_q_;    // from and to modes of mass 1
};

}  // namespace sprag
