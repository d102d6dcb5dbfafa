// Least squares where columns may depend on each other: the basic solution of a QR factorization
// with column pivoting, 0 in the columns that add nothing. Eigen's own solve() goes by exact zeros,
// this by the factorization's threshold.
#pragma once

#include <Eigen/QR>

namespace sprag {

using PivotedQR = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;

/// X that minimizes |A X - B|, A having been factorized.
inline Eigen::MatrixXd basic_solution(const PivotedQR& qr, Eigen::MatrixXd B) {
  const Eigen::Index rank = qr.rank();
  B.applyOnTheLeft(qr.householderQ().adjoint());
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(qr.cols(), B.cols());
  X.topRows(rank) =
      qr.matrixQR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(B.topRows(rank));
  return qr.colsPermutation() * X;
}

}  // namespace sprag
