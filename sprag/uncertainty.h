/// \file
/// \brief How far a machine may be from its model: standard deviations of its parameters, and hard
/// limits of deviations.
///
/// A ParameterUncertainty is the table [parameters] of a scene, for estimators. A Tolerance is the
/// table [tolerance], for the bound B on the error energy, which is proven within these limits.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

namespace sprag {

/// \brief Joint normal distribution of P parameters about the values of the scene.
///
/// sigma has the unit of the parameter's value.
struct ParameterUncertainty {
  std::vector<std::string> keys;  ///< keys of scene files, in the order of the file; no key twice
  Eigen::VectorXd sigma;          ///< standard deviations, P entries, > 0
  Eigen::MatrixXd correlation;    ///< P x P, symmetric, positive semidefinite, unit diagonal
  /// \brief Whether a filter only considers the parameter (Schmidt 1966): its uncertainty is part
  /// of the covariance, and its value is never updated. P entries.
  std::vector<bool> consider;

  /// \brief Whether no parameter is uncertain.
  /// \return true if P is 0.
  bool empty() const { return keys.empty(); }
  /// \brief Number of parameters.
  /// \return P.
  Eigen::Index size() const { return sigma.size(); }

  /// \brief A square root of the covariance. It exists for a singular correlation too.
  /// \return S, P x P, with S S^T = diag(sigma) correlation diag(sigma); not triangular.
  Eigen::MatrixXd root_of_covariance() const;
};

/// \brief Largest deviations of the machine and its event reports from the scene, all >= 0.
///
/// A standard deviation is not such a limit. A normal distribution must be truncated, for example
/// at 4 sigma; B then holds while no deviation is larger.
struct Tolerance {
  /// \brief Largest value of stiffness and of damping that a scene may specify.
  static constexpr double largest_share = 0.5;
  /// \brief Largest value of restitution that a scene may specify.
  static constexpr double largest_restitution = 1.0;

  double time = 0.0;         ///< of a reported event time from the true one [s]
  double restitution = 0.0;  ///< of each restitution epsilon, absolute; may differ at each impact
  double stiffness = 0.0;    ///< the true K is (1 + k) K with |k| <= stiffness
  double damping = 0.0;      ///< the true C is (1 + c) C with |c| <= damping
  double force = 0.0;        ///< of the force on the machine, in the norm |f| = sqrt(f^T M^-1 f)
  double clearance = 0.0;    ///< of each clearance [m]

  /// \brief Whether some deviation is allowed. Otherwise the bound is that of an exact machine.
  /// \return true if one is > 0.
  bool any() const {
    return std::max({time, restitution, stiffness, damping, force, clearance}) > 0.0;
  }
  /// \brief Compares all members.
  friend bool operator==(const Tolerance&, const Tolerance&) = default;
};

}  // namespace sprag
