// How uncertain parameters of a machine are: standard deviations and correlations, [parameters] of
// a scene.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace sprag {

/// A joint normal distribution of P parameters about their nominal values, which are the scene's.
/// A key names a parameter as identification does (parameters/unknowns.h), and sigma has the
/// unit of that parameter's value.
struct ParameterUncertainty {
  std::vector<std::string> keys;  ///< in the order of the scene file; none twice
  Eigen::VectorXd sigma;          ///< standard deviations, P entries, > 0
  Eigen::MatrixXd correlation;    ///< P x P, symmetric, positive semidefinite, unit diagonal
  /// Whether a filter only considers the parameter (Schmidt 1966): its uncertainty counts, its
  /// value is never corrected. P entries.
  std::vector<bool> consider;

  bool empty() const { return keys.empty(); }
  Eigen::Index size() const { return sigma.size(); }

  /// \brief A root of the covariance.
  /// \return S, P x P, with S S^T = diag(sigma) correlation diag(sigma). It exists for a singular
  /// correlation as well and is not triangular.
  Eigen::MatrixXd root_of_covariance() const;
};

}  // namespace sprag
