// Belief about the state (q, u) at an instant: mean and a square root S of the covariance P = S
// S^T; and its update by a scalar measurement.
#pragma once

#include <Eigen/Core>
#include <limits>

namespace sprag {

struct Belief {
  Eigen::VectorXd q, u;      ///< mean, f entries each
  Eigen::MatrixXd S_q, S_u;  ///< f rows each; the first `columns` columns are S
  Eigen::Index columns = 0;
};

/// A smaller standard deviation of a measurement, as a share of its terms, is below their rounding.
inline constexpr double measurement_rounding = 32.0 * std::numeric_limits<double>::epsilon();

/// Scalar measurement with Potter's square-root update (Bierman 1977): residual = measured -
/// expected, phi = S^T times the measurement's row, r the variance of its noise. With alpha = phi^T
/// phi + r and K = S phi / alpha
///
///   x += K residual,   S -= K phi^T / (1 + sqrt(r / alpha)).
class PotterUpdate {
 public:
  /// `phi` must outlive this.
  PotterUpdate(Eigen::Ref<const Eigen::VectorXd> phi, double residual, double r);

  /// Updates some rows x of the mean and the same rows of S. Does not allocate.
  void apply(Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> S) const;

 private:
  Eigen::Ref<const Eigen::VectorXd> phi_;
  double gain_, shrink_;
};

}  // namespace sprag
