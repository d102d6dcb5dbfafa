// Prior of the filter: uncertainty of a scene's start, model and event times.
#pragma once

#include <Eigen/Core>

#include "sprag/scene.h"

namespace sprag {

/// Errors of the start and of the events. The errors of q and u at the start are independent, with
/// covariances q q^T and u u^T.
struct Uncertainty {
  Eigen::MatrixXd q, u;              ///< f x f
  double jitter = 0.0;               ///< sigma, standard deviation of event times [s]
  Eigen::MatrixXd drift_q, drift_u;  ///< roots of the process noise per unit of time; empty: none
  /// A contact that closes at t = 0 may be inside its support. False: it rests on the support.
  bool may_start_inside = false;
  /// Root of the white noise of velocities by errors of sampled forces, per unit of time; empty:
  /// none.
  Eigen::MatrixXd input_noise = {};
};

/// Prior from a scene: the energies of [replica] uncertainty, half of each in q and half in u;
/// [replica] drift in the same way; [events] jitter. Without an uncertainty each mode gets the
/// energy_scale() of the model and the replica's start, or 1 in the scene's unit if that is 0.
/// Rigid motions, which have no potential energy, get the scene's length_scale(). [replica] sigma_q
/// and sigma_u replace the uncertainty. may_start_inside is penetration = "release".
Uncertainty uncertainty_of(const Scene& scene);

}  // namespace sprag
