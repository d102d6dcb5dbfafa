#include "sprag/detail/estimates/belief.h"

#include <cmath>

namespace sprag {

PotterUpdate::PotterUpdate(Eigen::Ref<const Eigen::VectorXd> phi, double residual, double r)
    : phi_(phi) {
  const double alpha = phi.squaredNorm() + r;
  gain_ = residual / alpha;
  shrink_ = 1.0 / (alpha * (1.0 + std::sqrt(r / alpha)));
}

void PotterUpdate::apply(Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> S) const {
  for (Eigen::Index i = 0; i < S.rows(); ++i) {
    const double along = S.row(i).dot(phi_.transpose());
    x[i] += gain_ * along;
    S.row(i) -= along * shrink_ * phi_.transpose();
  }
}

}  // namespace sprag
