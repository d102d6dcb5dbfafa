// How far a scene's model, its start and its event times are to be trusted.
#pragma once

#include <Eigen/Core>

#include "sprag/scene.h"

namespace sprag {

/// What is not known of a machine's start and of its events. The errors of q and u at the start are
/// independent, with covariances q q^T and u u^T.
struct Uncertainty {
  Eigen::MatrixXd q, u;              ///< f x f
  double jitter = 0.0;               ///< sigma, standard deviation of event times [s]
  Eigen::MatrixXd drift_q, drift_u;  ///< of what the model lacks per unit of time; or empty
  /// What closes at t = 0 may be inside its support. Otherwise it rests on it.
  bool may_start_inside = false;
};

/// As a scene says: the energies of its [replica] uncertainty, half of each in q and half in u, its
/// [replica] drift likewise, and its [events] jitter. Without the first each mode gets the
/// energy_scale() of the model and the replica's start; 1, in the scene's unit, where that is 0.
/// Rigid motions, which have no energy of position, get the scene's length_scale(). Or the standard
/// deviations that it gives in place of the first. A scene whose master may start inside a support
/// is told by its penetration = "release".
Uncertainty uncertainty_of(const Scene& scene);

}  // namespace sprag
