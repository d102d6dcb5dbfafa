#include "mechanics/energy.h"

#include <Eigen/Eigenvalues>

namespace sprag {

namespace {

bool is_diagonal(const Eigen::MatrixXd& matrix) {
  return matrix == Eigen::MatrixXd(matrix.diagonal().asDiagonal());
}

Eigen::VectorXd difference(const Eigen::Ref<const Eigen::VectorXd>& master,
                           const Eigen::Ref<const Eigen::VectorXd>& replica) {
  Eigen::VectorXd result = master;
  result.head(replica.size()) -= replica;
  return result;
}

}  // namespace

ErrorEnergy::ErrorEnergy(const Model& model) {
  if (is_diagonal(model.M) && is_diagonal(model.K)) {
    mass_ = model.M.diagonal();
    stiffness_ = model.K.diagonal();
    if ((mass_.array() <= 0.0).any()) throw ModelError("M is not positive definite");
    return;
  }
  if (model.M.llt().info() != Eigen::Success) throw ModelError("M is not positive definite");
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> modes(model.K, model.M);
  if (modes.info() != Eigen::Success) throw ModelError("K v = w^2 M v has no solution");
  to_modes_ = modes.eigenvectors().transpose() * model.M;
  mass_ = Eigen::VectorXd::Ones(model.M.rows());
  // Rounding may leave a rigid-body mode with a stiffness just below zero.
  stiffness_ = modes.eigenvalues().cwiseMax(0.0);
}

Eigen::VectorXd ErrorEnergy::operator()(const Eigen::Ref<const Eigen::VectorXd>& q_m,
                                        const Eigen::Ref<const Eigen::VectorXd>& u_m,
                                        const Eigen::Ref<const Eigen::VectorXd>& q_s,
                                        const Eigen::Ref<const Eigen::VectorXd>& u_s) const {
  Eigen::VectorXd q = difference(q_m, q_s);
  Eigen::VectorXd u = difference(u_m, u_s);
  if (to_modes_.size() != 0) {
    q = to_modes_ * q;
    u = to_modes_ * u;
  }
  Eigen::VectorXd energy(q.size() + 1);
  energy.tail(q.size()) =
      0.5 * (mass_.array() * u.array().square() + stiffness_.array() * q.array().square());
  energy[0] = energy.tail(q.size()).sum();
  return energy;
}

}  // namespace sprag
