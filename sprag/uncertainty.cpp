#include "sprag/uncertainty.h"

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {

// With correlation = V Lambda V^T, S = diag(sigma) V Lambda^1/2. Rounding may make an eigenvalue
// negative.
Eigen::MatrixXd ParameterUncertainty::root_of_covariance() const {
  if (empty()) return Eigen::MatrixXd(0, 0);
  const ExtendedEigenpairs pairs = eigenpairs(correlation.cast<Extended>());
  const VectorR roots = pairs.values.cwiseMax(Extended(0)).cwiseSqrt();
  const MatrixR scaled = pairs.vectors * roots.asDiagonal();
  return sigma.asDiagonal() * scaled.cast<double>();
}

}  // namespace sprag
