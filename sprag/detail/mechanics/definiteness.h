// Whether a symmetric matrix is positive definite, beyond what rounding may have made of it.
#pragma once

#include <Eigen/Core>

namespace sprag {

struct Definiteness {
  double smallest = 0.0;         ///< eigenvalue; zero if it is so within rounding
  bool semidefinite = false;     ///< within rounding
  Eigen::MatrixXd null_motions;  ///< unit columns that the matrix takes to zero

  bool definite() const { return semidefinite && null_motions.cols() == 0; }
};

/// Rounding is 1e-13 of the largest eigenvalue, where rows and columns are scaled to a unit
/// diagonal: that keeps all signs, and units of single coordinates do not matter.
Definiteness definiteness(const Eigen::MatrixXd& matrix);

}  // namespace sprag
