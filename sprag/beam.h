// Clamped-free Euler-Bernoulli beam by its first n eigenmodes: eqs. (19)-(22) of Baumann & Leine
// 2014, with the printed sign of (19) (tip value -2 for odd modes, +2 for even ones).
#pragma once

#include <Eigen/Core>

#include "sprag/model.h"

namespace sprag {

struct Beam {
  int modes = 1;                   ///< n, 1..200 in scene files
  double length = 1.0;             ///< l [m]
  double bending_stiffness = 1.0;  ///< EI [N m^2]
  double mass_per_length = 1.0;    ///< rho A [kg/m]
  double damping = 0.0;            ///< d [N s/m^2], viscous against the frame
  /// zeta_i of each mode, n entries, in place of d; empty: d holds.
  Eigen::VectorXd damping_ratio = {};
};

/// beta_i l, i >= 1: i-th positive root of cos(x) cosh(x) + 1 = 0, right to a few units in the last
/// place.
double wavenumber(int i);

/// v_i(x) of (19) at x = xi l, xi in [0, 1]; no overflow or cancellation for any i >= 1.
double mode_shape(int i, double xi);

/// (1/l) times the integral of v_i over the beam: -2 sigma_i / (beta_i l).
double mode_mean(int i);

/// v(x_c) for all n modes; x_c in [0, length].
Eigen::VectorXd mode_shapes(const Beam& beam, double x_c);

/// Diagonals of M, C, K of (22), n entries each.
Eigen::VectorXd mass(const Beam& beam);
Eigen::VectorXd damping(const Beam& beam);
Eigen::VectorXd stiffness(const Beam& beam);

/// Direction of f(t) per unit of frame acceleration e''(t): -integral of v rho A dx, n entries.
Eigen::VectorXd inertia_direction(const Beam& beam);

/// M, C and K of (22), without contacts; with the force of a shaken frame, e(t) = `excitation`,
/// where its amplitude is not 0.
Model beam_model(const Beam& beam, const Harmonic& excitation = {});

/// A support at x_c in [0, length]: below the beam, g = +w + c, or above it, g = -w + c. `motion`:
/// e(t) where it stands on the ground, which the coordinates' frame moves against; {} where it
/// moves with the frame.
enum class Side { below, above };
Contact beam_contact(const Beam& beam, double x_c, Side side, double clearance, double restitution,
                     const Harmonic& motion = {});

/// w of a contact, n entries, that is moved along the beam: from x_c = `from`, where its direction
/// is `w`, to `to`, on the side where it is.
Eigen::VectorXd moved_direction(const Beam& beam, const Eigen::VectorXd& w, double from, double to);

}  // namespace sprag
