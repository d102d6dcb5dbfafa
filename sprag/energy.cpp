#include "sprag/energy.h"

#include <limits>
#include <utility>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {

namespace {

Eigen::VectorXd difference(const Eigen::Ref<const Eigen::VectorXd>& master,
                           const Eigen::Ref<const Eigen::VectorXd>& replica) {
  Eigen::VectorXd result = master;
  result.head(replica.size()) -= replica;
  return result;
}

// Phi^-1 = diag(1 / mass) Phi^T M.
Eigen::MatrixXd to_modes(const NaturalModes& modes, const Model& model) {
  return modes.mass.cwiseInverse().asDiagonal() * product(modes.Phi.transpose(), model.M);
}

}  // namespace

NaturalModes natural_modes(const Model& model) {
  if (model.M.isDiagonal(0.0) && model.K.isDiagonal(0.0)) {
    if ((model.M.diagonal().array() <= 0.0).any()) {
      throw ModelError("M is not positive definite");
    }
    return {Eigen::MatrixXd::Identity(model.M.rows(), model.M.rows()), model.M.diagonal(),
            model.K.diagonal(), true};
  }
  const double unit = power_of_two_above(model.M.cwiseAbs().maxCoeff());
  const Eigen::MatrixXd M = model.M / unit;
  if (!CholeskyFactor(M).exists()) throw ModelError("M is not positive definite");
  const auto [values, vectors] = eigenpairs(model.K / unit, M);
  const Eigen::Index f = model.M.rows();
  // Rounding gives a rigid motion a small stiffness of either sign. Its square displacement would
  // make it visible in V.
  const double rounding = static_cast<double>(f) * std::numeric_limits<double>::epsilon() *
                          values.cwiseAbs().maxCoeff();
  return {vectors, Eigen::VectorXd::Constant(f, unit),
          unit * (values.array() > rounding).select(values, 0.0), false};
}

Eigen::MatrixXd damping_of_ratios(const Model& model, const Eigen::VectorXd& zeta) {
  const NaturalModes modes = natural_modes(model);
  const Eigen::VectorXd critical =
      2.0 * modes.mass.cwiseProduct(modes.stiffness).cwiseSqrt().cwiseProduct(zeta);
  if (modes.of_coordinates) return critical.asDiagonal();
  // Phi^T C Phi = diag(critical).
  const Eigen::MatrixXd inverse = to_modes(modes, model);
  const Eigen::MatrixXd C = product(inverse.transpose(), critical.asDiagonal() * inverse);
  return 0.5 * (C + C.transpose());
}

ErrorEnergy::ErrorEnergy(const Model& model) {
  NaturalModes modes = natural_modes(model);
  if (!modes.of_coordinates) {
    to_modes_ = to_modes(modes, model);
  }
  mass_ = std::move(modes.mass);
  stiffness_ = std::move(modes.stiffness);
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
