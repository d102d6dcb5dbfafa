#include "tests/support/random.h"

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {

Eigen::MatrixXd Random::matrix(Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd A(rows, columns);
  for (double& entry : A.reshaped()) entry = uniform(-1.0, 1.0);
  return A;
}

Eigen::VectorXd Random::vector(Eigen::Index n) { return matrix(n, 1); }

Eigen::MatrixXd Random::orthogonal(Eigen::Index n) {
  return QR(matrix(n, n)).Q_times(Eigen::MatrixXd::Identity(n, n));
}

Eigen::MatrixXd Random::positive_definite(Eigen::Index n, double low, double high) {
  const Eigen::MatrixXd Q = orthogonal(n);
  Eigen::VectorXd values(n);
  for (double& value : values) value = uniform(low, high);
  const Eigen::MatrixXd A = product(Q * values.asDiagonal(), Q.transpose());
  return 0.5 * (A + A.transpose());
}

}  // namespace sprag
