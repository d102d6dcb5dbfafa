// Motion of a machine of the family while the contacts H are held: their gap velocities are zero,
// and the motion is in the null space of W_H^T, with the contact directions W_H. With P = I - W_H
// G^-1 W_H^T and G = W_H^T W_H,
//
//   y'' = P (F - C y' - K y) - W_H G^-1 s'',   lambda = -G^-1 gamma_free',
//
// where gamma_free' are the gaps' accelerations without contact forces. x_H below is the steady
// response with these contacts held.
#pragma once

#include <Eigen/Core>

#include "sprag/contact_event.h"
#include "sprag/detail/identification/machine_family.h"

namespace sprag {

class HeldFlight {
 public:
  /// `held` is not empty, and its directions are linearly independent. Throws ModelError if the
  /// machine has a recorded input.
  HeldFlight(const Machine& machine, ContactSet held);

  /// Moves columns of the motion about the free machine's steady response in place, from t by tau:
  /// y and u, n x c. `inputs`, (2 G + J) x c, are the inputs of each column without clearances.
  void move(double t, double tau, const Eigen::MatrixXd& inputs, Eigen::MatrixXd& Y,
            Eigen::MatrixXd& U) const;

  /// W_H lambda, n entries, from the gaps' accelerations without contact forces, m entries.
  Eigen::VectorXd force(const Eigen::VectorXd& free_rates) const;

 private:
  // The free machine's steady response to each input of the harmonics, minus x_H: y over u, 2n x
  // 2G.
  Eigen::MatrixXd offset(double t) const;

  bool modal_ = false;
  ContactSet held_;
  Eigen::MatrixXd fixed_;  // n x h: orthonormal basis of the columns of W_H
  Eigen::MatrixXd N_;      // n x (n - h): modes in the null space of W_H^T
  Eigen::MatrixXd C_, K_;  // of these modes; their diagonals if modal
  // On these modes: of the constant forces, of the fixed coordinates.
  Eigen::MatrixXd forces_, pull_;
  Eigen::MatrixXd push_;  // -W_H G^-1, n x h
  Eigen::VectorXd frequencies_;
  Eigen::MatrixXcd offset_;  // the free machine's steady response to e^(i Omega t) minus x_H
};

/// (u+ - u-) / -gamma- of an impact of the contact while the contacts `staying` are held. If
/// `staying` contains the contact itself, it closes with restitution 0.
Eigen::VectorXd jump_of(const Machine& machine, int contact, ContactSet staying);

/// Whether the directions of these contacts are linearly independent.
bool are_independent(const Machine& machine, ContactSet contacts);

/// Whether one impact of the contact explains that `held` were closed before it and `staying` are
/// closed after it: the impact must push away every released contact.
bool is_one_impact(const Machine& machine, int contact, ContactSet held, ContactSet staying);

}  // namespace sprag
