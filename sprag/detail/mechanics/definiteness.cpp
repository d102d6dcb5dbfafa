#include "sprag/detail/mechanics/definiteness.h"

#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {

Definiteness definiteness(const Eigen::MatrixXd& given) {
  const double largest_entry = given.cwiseAbs().maxCoeff();
  const double unit = largest_entry > 0.0 ? power_of_two_above(largest_entry) : 1.0;
  const Eigen::MatrixXd matrix = given / unit;
  const Eigen::VectorXd diagonal = matrix.diagonal();
  const double largest = diagonal.cwiseAbs().maxCoeff();
  const double usual = largest > 0.0 ? largest : 1.0;
  const Eigen::VectorXd scale =
      diagonal.unaryExpr([usual](double d) { return 1.0 / std::sqrt(d > 0.0 ? d : usual); });
  const Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::VectorXd values = eigenvalues(scaled);
  const double rounding = 1e-13 * values.cwiseAbs().maxCoeff();

  Definiteness result;
  result.semidefinite = values[0] >= -rounding;
  const Eigen::Index zeros = (values.array().abs() <= rounding).count();
  if (result.semidefinite && zeros > 0) {
    const MatrixR motions = eigenpairs(scaled.cast<Extended>()).vectors.leftCols(zeros);
    result.null_motions = scale.asDiagonal() * motions.cast<double>();
    result.null_motions.colwise().normalize();
  } else {
    result.smallest = unit * eigenvalues(matrix)[0];
  }
  return result;
}

}  // namespace sprag
