/// \file
/// \brief Synchronization error energy V, eqs. (23) and (24) of Baumann & Leine 2014.
///
///     V = 1/2 |u_m - u_s|_M^2 + 1/2 |q_m - q_s|_K^2 = V_1 + ... + V_f,   V_i >= 0
#pragma once

#include <Eigen/Core>

#include "sprag/model.h"

namespace sprag {

/// \brief Undamped modes K Phi = M Phi diag(stiffness / mass) with Phi^T M Phi = diag(mass).
///
/// The modes are in order of ascending frequency and share one mass, a power of two. If M and K are
/// diagonal, the modes are the coordinates, in their order.
struct NaturalModes {
  Eigen::MatrixXd Phi;              ///< f x f
  Eigen::VectorXd mass, stiffness;  ///< f entries each; a rigid motion has stiffness 0 exactly
  bool of_coordinates = false;      ///< Phi is the identity
};

/// \brief Computes the undamped modes.
/// \param model the machine.
/// \return the modes.
/// \throws ModelError if M is not positive definite.
NaturalModes natural_modes(const Model& model);

/// \brief Damping matrix that gives the natural modes prescribed damping ratios.
/// \param model the machine; its C is not used.
/// \param zeta f entries >= 0, in the order of natural_modes().
/// \return C, f x f.
/// \throws ModelError if M is not positive definite.
Eigen::MatrixXd damping_of_ratios(const Model& model, const Eigen::VectorXd& zeta);

/// \brief Error energy V and its parts V_i, one for each natural mode.
class ErrorEnergy {
 public:
  /// \brief Prepares the modes of a machine.
  /// \param model the machine.
  /// \throws ModelError if M is not positive definite.
  explicit ErrorEnergy(const Model& model);

  /// \brief Error energy between two states. Missing entries of q_s and u_s count as 0.
  /// \param q_m coordinates of the master, f entries.
  /// \param u_m velocities of the master, f entries.
  /// \param q_s coordinates of the estimate, at most f entries.
  /// \param u_s velocities of the estimate, at most f entries.
  /// \return f + 1 entries: V, V_1, ..., V_f, in the scene's unit of energy.
  Eigen::VectorXd operator()(const Eigen::Ref<const Eigen::VectorXd>& q_m,
                             const Eigen::Ref<const Eigen::VectorXd>& u_m,
                             const Eigen::Ref<const Eigen::VectorXd>& q_s,
                             const Eigen::Ref<const Eigen::VectorXd>& u_s) const;

 private:
  Eigen::MatrixXd to_modes_;          // empty where M and K are diagonal
  Eigen::VectorXd mass_, stiffness_;  // of each coordinate or mode
};

}  // namespace sprag
