/// \file
/// \brief Clamped-free Euler-Bernoulli beam by its first n eigenmodes: eqs. (19)-(22) of Baumann &
/// Leine 2014.
///
/// Mode shapes have the printed sign of (19): the tip value is -2 for odd modes and +2 for even
/// modes. Coordinates are the modal amplitudes. Contacts are counted from 0.
#pragma once

#include <Eigen/Core>

#include "sprag/model.h"

namespace sprag {

/// \brief Data of a beam.
struct Beam {
  int modes = 1;                   ///< n, 1..200 in scene files
  double length = 1.0;             ///< l [m]
  double bending_stiffness = 1.0;  ///< EI [N m^2]
  double mass_per_length = 1.0;    ///< rho A [kg/m]
  double damping = 0.0;            ///< d [N s/m^2], viscous against the frame
  /// \brief zeta_i of each mode, n entries, instead of d; empty: d is used.
  Eigen::VectorXd damping_ratio = {};
};

/// \brief Wavenumber of a mode.
/// \param i number of the mode, >= 1.
/// \return beta_i l, the i-th positive root of cos(x) cosh(x) + 1 = 0, accurate to a few units in
/// the last place.
double wavenumber(int i);

/// \brief Mode shape of (19), without overflow or cancellation for any mode.
/// \param i number of the mode, >= 1.
/// \param xi x / l in [0, 1].
/// \return v_i(x).
double mode_shape(int i, double xi);

/// \brief Mean of a mode shape over the beam, -2 sigma_i / (beta_i l).
/// \param i number of the mode, >= 1.
/// \return (1/l) times the integral of v_i.
double mode_mean(int i);

/// \brief All mode shapes at one point.
/// \param beam the beam.
/// \param x_c point in [0, length] [m].
/// \return v(x_c), n entries.
Eigen::VectorXd mode_shapes(const Beam& beam, double x_c);

/// \brief Diagonal of M of (22).
/// \param beam the beam.
/// \return n entries.
Eigen::VectorXd mass(const Beam& beam);
/// \brief Diagonal of C of (22).
/// \param beam the beam.
/// \return n entries.
Eigen::VectorXd damping(const Beam& beam);
/// \brief Diagonal of K of (22).
/// \param beam the beam.
/// \return n entries.
Eigen::VectorXd stiffness(const Beam& beam);

/// \brief Direction of f(t) per unit of frame acceleration e''(t).
/// \param beam the beam.
/// \return minus the integral of v rho A dx, n entries.
Eigen::VectorXd inertia_direction(const Beam& beam);

/// \brief Model of the beam without contacts.
/// \param beam the beam.
/// \param excitation motion e(t) of the frame [m]; amplitude 0: the frame rests.
/// \return M, C and K of (22), and the force of the shaken frame if its amplitude is not 0.
Model beam_model(const Beam& beam, const Harmonic& excitation = {});

/// \brief Side of the beam on which a support is: below, g = +w + c; above, g = -w + c.
enum class Side {
  below,  ///< g = +w + c
  above   ///< g = -w + c
};

/// \brief Contact of the beam with a support.
/// \param beam the beam.
/// \param x_c position in [0, length] [m].
/// \param side side of the support.
/// \param clearance c [m].
/// \param restitution epsilon in [0, 1].
/// \param motion e(t) for a support on the ground, against which the coordinates' frame moves; {}
/// for a support that moves with the frame.
/// \return the contact, w with n entries.
Contact beam_contact(const Beam& beam, double x_c, Side side, double clearance, double restitution,
                     const Harmonic& motion = {});

}  // namespace sprag
