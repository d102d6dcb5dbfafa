// Exponential of a dense matrix by scaling and squaring (Higham 2008, ch. 10).
#pragma once

#include <Eigen/Core>

namespace sprag {

class MatrixExponential {
 public:
  /// For matrices of this size, at most.
  explicit MatrixExponential(Eigen::Index size);

  /// Replaces A, n x n, by exp(A). The relative error is about the rounding error times the norm of
  /// A, so that A should be balanced. Does not allocate.
  void apply(Eigen::Ref<Eigen::MatrixXd> A);

 private:
  Eigen::MatrixXd power_, square_, cube_, fourth_, sum_;
};

}  // namespace sprag
