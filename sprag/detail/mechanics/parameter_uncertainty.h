// Uncertainty of the parameters of a machine: standard deviations and correlations, the table
// [parameters] of a scene.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace sprag {

/// A joint normal distribution of P parameters about their nominal values, given in the scene. The
/// keys are those of identification (sprag/detail/parameters/unknowns.h), and sigma has the unit of
/// the parameter's value.
struct ParameterUncertainty {
  std::vector<std::string> keys;  ///< in the order of the scene file; no key twice
  Eigen::VectorXd sigma;          ///< standard deviations, P entries, > 0
  Eigen::MatrixXd correlation;    ///< P x P, symmetric, positive semidefinite, unit diagonal
  /// Whether a filter only considers the parameter (Schmidt 1966): its uncertainty is part of the
  /// covariance, and its value is never updated. P entries.
  std::vector<bool> consider;

  bool empty() const { return keys.empty(); }
  Eigen::Index size() const { return sigma.size(); }

  /// \brief A square root of the covariance.
  /// \return S, P x P, with S S^T = diag(sigma) correlation diag(sigma). S is not triangular. It
  /// exists for a singular correlation too.
  Eigen::MatrixXd root_of_covariance() const;
};

}  // namespace sprag
