// How many modes an observer needs: the master of the whole machine gives the contact events, and a
// replica of its first modes alone follows them, started on the master's own state, so that all it
// does wrong is for want of modes.
#pragma once

#include <vector>

#include "sprag/analysis/trial.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

struct Accuracy {
  double tolerance = 0.0;  ///< [m]
  double duration = 0.0;   ///< of the trial run [s]
  /// Smallest number of modes, by ascending frequency, with which the observed tip (a scene without
  /// beam: the gap at every contact) stays within the tolerance of all modes' one, and stays so
  /// with more of them.
  int modes = 0;
  /// Largest change [m] with n modes, for n = modes - 1 (unless modes is 1), ..., all.
  struct Change {
    int modes;
    double change;
  };
  std::vector<Change> changes;
};

/// Tolerance [m] > 0. Throws ModelError where damping couples the modes, SimulationError where the
/// master cannot go on.
Accuracy find_accuracy(const Scene& scene, double tolerance, double duration,
                       const TrialLimits& limits);

}  // namespace sprag
