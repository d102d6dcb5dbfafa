// Properties of a machine's matrices that decide on synchronization, without simulation:
// independence of the contact directions, monotonicity of the impact law, and which modes each
// contact responds to.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/model.h"

namespace sprag {

/// W in the metric M^-1, columns normalized to length 1.
struct Directions {
  int rank = 0;
  double condition = 1.0;      ///< infinity if the columns are dependent
  std::vector<int> dependent;  ///< contacts (from 0) of a linearly dependent combination, if any
};

/// M must be positive definite.
Directions directions(const Dynamics& dynamics);

/// Two stops on opposite sides of one coordinate: w_j = -a w_i with a > 0, so g_j + a g_i depends
/// on time alone.
struct OpposingStops {
  int i = 0, j = 0;   ///< contacts, from 0, i < j
  double room = 0.0;  ///< minimum of g_j + a g_i [m]; both cannot be closed at once if > 0
};

std::vector<OpposingStops> opposing_stops(const Model& model);

/// Whether impacts are nonexpansive in the norm of M for any set of closed contacts.
struct Monotonicity {
  bool common = true;     ///< one restitution for all contacts, or a single contact
  bool by_speed = false;  ///< several contacts, with restitutions that depend on the speed
  /// For different restitutions: smallest eigenvalue of DG + GD, D = diag((1-eps_i)/(1+eps_i))
  /// (Newton), or of G - EGE (Poisson), G scaled to a unit diagonal.
  double margin = 0.0;

  bool holds() const { return common || (!by_speed && margin >= -1e-12); }
};

Monotonicity monotonicity(const Dynamics& dynamics);

/// An undamped mode, K phi = omega^2 M phi, phi^T M phi = 1.
struct Mode {
  double omega = 0.0;
  int contact = -1;         ///< the contact with the largest `seen`
  double projection = 0.0;  ///< w_i^T phi of that contact
  double seen = 0.0;        ///< |w_i^T phi| relative to that contact's largest over all modes
  double decades = 0.0;     ///< decay of V per unit of time by damping alone

  bool barely_seen() const { return seen < 1e-2; }
};

/// In the order of the coordinates if M and K are diagonal, else by ascending omega.
std::vector<Mode> modes(const Dynamics& dynamics);

/// Largest real part of the roots of s^2 + 2 delta s + kappa, delta, kappa >= 0.
double slow_root(double delta, double kappa);

/// Largest real part of the eigenvalues of the damped machine in free flight.
double slow_root(const Flow& free_flight);

/// Decades per unit of time by which V ~ e^(2 Re(s) t) decays.
double decades_of_V(double real_part);

}  // namespace sprag
