// A machine of the family while contacts are held: their gap velocities are zero, their gaps stay
// as they are, and what is left moves in the null space of W_H^T, W_H being their columns. With P =
// I - W_H G^-1 W_H^T, G = W_H^T W_H, and x_H the steady response with these contacts held,
//
//   y'' = P (F - C y' - K y) - W_H G^-1 s'',   lambda = -G^-1 gamma_free',
//
// gamma_free' being the gaps' accelerations without contact forces.
#pragma once

#include <Eigen/Core>

#include "sprag/contact_event.h"
#include "sprag/detail/identification/machine_family.h"

namespace sprag {

class HeldFlight {
 public:
  /// `held` is not empty, and its directions are independent of each other.
  HeldFlight(const Machine& machine, ContactSet held);

  /// Moves columns of the motion about the free machine's steady response, in place, from t on by
  /// tau: y and u, n x c. `inputs`, (2 G + J) x c, are the inputs of each but its clearances.
  void move(double t, double tau, const Eigen::MatrixXd& inputs, Eigen::MatrixXd& Y,
            Eigen::MatrixXd& U) const;

  /// W_H lambda, n entries, of the gaps' accelerations without contact forces, m entries.
  Eigen::VectorXd force(const Eigen::VectorXd& free_rates) const;

 private:
  // The free machine's steady response to each input of the harmonics less x_H: y over u, 2n x 2G.
  Eigen::MatrixXd offset(double t) const;

  bool modal_ = false;
  ContactSet held_;
  Eigen::MatrixXd fixed_;          // n x h: orthonormal columns that span W_H's
  Eigen::MatrixXd N_;              // n x (n - h): modes of what moves
  Eigen::MatrixXd C_, K_;          // of these modes; their diagonals where modal
  Eigen::MatrixXd forces_, pull_;  // on them: constant ones, and of what is fixed
  Eigen::MatrixXd push_;           // -W_H G^-1, n x h
  Eigen::VectorXd frequencies_;
  Eigen::MatrixXcd offset_;  // the free machine's steady response to 1 e^(i Omega t) less x_H
};

/// (u+ - u-) / -gamma- of the impact of a contact while those of `staying` are held; where it is
/// itself among these, it closes to stay.
Eigen::VectorXd jump_of(const Machine& machine, int contact, ContactSet staying);

/// Whether directions of these contacts do not depend on each other.
bool are_independent(const Machine& machine, ContactSet contacts);

/// Whether that impact is what happens where `held` were closed before it and `staying` are behind
/// it: what leaves must be pushed away, and what stays be held without help.
bool is_one_impact(const Machine& machine, int contact, ContactSet held, ContactSet staying);

}  // namespace sprag
