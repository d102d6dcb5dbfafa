// Synchronization error energy, eqs. (23) and (24) of Baumann & Leine 2014:
// V = 1/2 |u_m - u_s|_M^2 + 1/2 |q_m - q_s|_K^2 and its parts V_i >= 0, which sum to V.
#pragma once

#include <Eigen/Core>

#include "sprag/model.h"

namespace sprag {

/// Undamped modes K Phi = M Phi diag(stiffness / mass), Phi^T M Phi = diag(mass): by ascending
/// frequency, with one mass for all, a power of two; where M and K are diagonal the coordinates
/// themselves.
struct NaturalModes {
  Eigen::MatrixXd Phi;              ///< f x f
  Eigen::VectorXd mass, stiffness;  ///< f entries; a rigid motion has stiffness 0 exactly
  bool of_coordinates = false;      ///< Phi is the identity
};

/// Throws ModelError if M is not positive definite.
NaturalModes natural_modes(const Model& model);

/// C that gives the natural modes of M and K the damping ratios zeta, f entries >= 0: by coordinate
/// where M and K are diagonal, else by ascending frequency. Throws ModelError as natural_modes().
Eigen::MatrixXd damping_of_ratios(const Model& model, const Eigen::VectorXd& zeta);

/// The parts V_i belong to the natural modes.
class ErrorEnergy {
 public:
  /// Throws ModelError if M is not positive definite.
  explicit ErrorEnergy(const Model& model);

  /// Returns f + 1 entries: V, V_1, ..., V_f, in the scene's unit of energy. q_m and u_m have f
  /// entries; q_s and u_s may be shorter: the entries they lack count as zero.
  Eigen::VectorXd operator()(const Eigen::Ref<const Eigen::VectorXd>& q_m,
                             const Eigen::Ref<const Eigen::VectorXd>& u_m,
                             const Eigen::Ref<const Eigen::VectorXd>& q_s,
                             const Eigen::Ref<const Eigen::VectorXd>& u_s) const;

 private:
  Eigen::MatrixXd to_modes_;          // empty where M and K are diagonal
  Eigen::VectorXd mass_, stiffness_;  // of each coordinate or mode
};

}  // namespace sprag
