// Test of a symmetric matrix for positive definiteness, within rounding.
#pragma once

#include <Eigen/Core>

namespace sprag {

struct Definiteness {
  double smallest = 0.0;         ///< smallest eigenvalue; zero if it is zero within rounding
  bool semidefinite = false;     ///< positive semidefinite within rounding
  Eigen::MatrixXd null_motions;  ///< basis of the null space, unit columns

  bool definite() const { return semidefinite && null_motions.cols() == 0; }
};

/// Rows and columns are scaled to a unit diagonal first: this keeps all signs and removes the units
/// of the coordinates. Eigenvalues below 1e-13 of the largest count as zero.
Definiteness definiteness(const Eigen::MatrixXd& matrix);

}  // namespace sprag
