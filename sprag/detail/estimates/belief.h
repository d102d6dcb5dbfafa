// Mean and a square root S of the covariance of the state (q, u) at an instant, P = S S^T, and a
// measurement of it.
#pragma once

#include <Eigen/Core>
#include <limits>

namespace sprag {

struct Belief {
  Eigen::VectorXd q, u;      ///< mean, f entries each
  Eigen::MatrixXd S_q, S_u;  ///< f rows each; the first `columns` columns are S
  Eigen::Index columns = 0;
};

/// A measurement of standard deviation below this share of its terms says nothing but their
/// rounding.
inline constexpr double measurement_rounding = 32.0 * std::numeric_limits<double>::epsilon();

/// A scalar measurement by Potter's square root: residual = measured - expected, `phi` its row on
/// each column of S, r the variance of its noise. With alpha = phi^T phi + r and K = S phi / alpha
///
///   x += K residual,   S -= K phi^T / (1 + sqrt(r / alpha)).
class PotterUpdate {
 public:
  /// `phi` must outlive this.
  PotterUpdate(Eigen::Ref<const Eigen::VectorXd> phi, double residual, double r);

  /// Of some rows x of what is estimated, and the same rows of S. Does not allocate.
  void apply(Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> S) const;

 private:
  Eigen::Ref<const Eigen::VectorXd> phi_;
  double gain_, shrink_;
};

}  // namespace sprag
