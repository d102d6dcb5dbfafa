#include "sprag/detail/identification/coupled_step.h"

#include <unsupported/Eigen/MatrixFunctions>

namespace sprag {

Eigen::MatrixXd coupled_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::MatrixXd& constant_forces, double tau) {
  const Eigen::Index n = K.rows(), J = constant_forces.cols();
  Eigen::MatrixXd generator = Eigen::MatrixXd::Zero(2 * n + J, 2 * n + J);
  generator.block(0, n, n, n).setIdentity();
  generator.block(n, 0, n, n) = -K;
  generator.block(n, n, n, n) = -C;
  generator.block(n, 2 * n, n, J) = constant_forces;
  generator *= tau;
  return generator.exp().topRows(2 * n);
}

}  // namespace sprag
