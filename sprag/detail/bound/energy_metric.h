// Energy coordinates of a machine: natural modes of mass 1, q = Phi z, u = Phi v, with x = (omega
// z, v) / sqrt 2 and |x|^2 = 1/2 |u|_M^2 + 1/2 |q|_K^2. Free flight is
//
//   z' = v,   v' = f(t) - D v - omega^2 z,   D = Phi^T C Phi,
//
// and an impulse Lambda on contact i adds Lambda w_i to v, where w_i stands for Phi^T w_i.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/energy.h"

namespace sprag {

/// Share that is rounding: in eigenvalues, in gaps and modal damping, and in a map of a small
/// matrix.
inline constexpr double share_of_rounding = 1e-9;
/// Directions depend on each other if an eigenvalue is below this share of the largest.
inline constexpr double dependent_share = 1e-10;
/// Generous estimate of a state's relative rounding from one event to the next.
inline constexpr double state_share_of_rounding = 64.0 * machine_epsilon;
/// The same of a time.
inline constexpr double time_share_of_rounding = 4.0 * machine_epsilon;

/// State and acceleration of a motion in modal coordinates, f entries each.
struct ModalState {
  Eigen::VectorXd z, v;
  Eigen::VectorXd acceleration;  ///< v', contact forces included
};

/// Constants of one machine with f coordinates and m contacts.
class EnergyMetric {
 public:
  /// Throws ModelError if M is not positive definite.
  explicit EnergyMetric(const Dynamics& dynamics);

  Eigen::Index coordinates() const { return omega_.size(); }
  const Eigen::VectorXd& omega() const { return omega_; }  ///< f natural frequencies [rad/s]
  const Eigen::MatrixXd& D() const { return D_; }          ///< f x f
  bool decoupled() const { return decoupled_; }            ///< D is diagonal
  const Eigen::MatrixXd& W() const { return W_; }          ///< f x m
  double omega_max() const { return omega_max_; }
  double damping() const { return damping_; }            ///< upper bound on |D| [1/s]
  double rate() const { return omega_max_ + damping_; }  ///< upper bound on |A| [1/s]

  /// |omega w_i| / |w_i|, |D w_i| / |w_i| and the root of their squares' sum: rate at which the
  /// direction of contact i turns in free flight [1/s].
  double omega_R(int contact) const { return omega_R_[contact]; }
  double omega_D(int contact) const { return omega_D_[contact]; }
  double omega_gamma(int contact) const { return omega_gamma_[contact]; }

  /// Constant and complex amplitudes of f(t), f and f x nf; frequencies in dynamics().
  const Eigen::VectorXd& force_constant() const { return force_constant_; }
  const Eigen::MatrixXcd& force_amplitudes() const { return force_amplitudes_; }
  /// Forces of the sampled inputs, f x channels.
  const Eigen::MatrixXd& input_forces() const { return input_forces_; }
  /// Largest growth rate of |x| in free flight, by the forces.
  double push() const { return push_; }
  /// Largest growth rate of |x'| of a motion with clutches, by the rate of change of forces and
  /// supports; and its largest step by a moving support.
  double jerk() const { return jerk_; }
  double support_step() const { return support_step_; }
  /// Bound on the rate of change of the free acceleration of gap i by force and support.
  double gap_jerk(int contact) const { return gap_jerk_[contact]; }

  /// z and v of q and u, f entries each. Do not allocate.
  void displacements(const Eigen::VectorXd& q, Eigen::VectorXd& z) const;
  void enter(const Eigen::VectorXd& q, const Eigen::VectorXd& u, ModalState& state) const;
  /// Sets the acceleration of a state at the time and with the contact forces of `motion`.
  void accelerate(const Motion& motion, ModalState& state) const;
  /// D v, f entries.
  void damp(const Eigen::Ref<const Eigen::VectorXd>& v, Eigen::VectorXd& Dv) const;

  const Dynamics& dynamics() const { return *dynamics_; }
  /// z = to_modes() q, q = from_modes() z.
  const Eigen::MatrixXd& to_modes() const { return to_modes_; }
  const Eigen::MatrixXd& from_modes() const { return from_modes_; }

 private:
  const Dynamics* dynamics_;
  bool of_coordinates_ = false;  // M and K diagonal
  bool decoupled_ = false;
  Eigen::MatrixXd to_modes_, from_modes_;
  Eigen::VectorXd omega_;
  Eigen::MatrixXd D_, W_;
  Eigen::VectorXd omega_R_, omega_D_, omega_gamma_, gap_jerk_;
  Eigen::VectorXd force_constant_;
  Eigen::MatrixXcd force_amplitudes_;
  Eigen::MatrixXd input_forces_;
  double omega_max_ = 0.0, damping_ = 0.0, push_ = 0.0, jerk_ = 0.0, support_step_ = 0.0;
};

/// |x|^2 of a state.
double energy(const EnergyMetric& metric, const ModalState& state);

/// |x'| of a state: the speed of its path in the energy norm.
double speed(const EnergyMetric& metric, const ModalState& state);

}  // namespace sprag
