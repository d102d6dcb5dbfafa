// How many modes an observer needs: the master of the whole machine gives the contact events, and a
// replica of its first modes alone follows them, started on the master's own state, so that all it
// does wrong is for want of modes. The same with corrections for the modes that are left out
// (reduction.h): they take fewer coordinates.
#pragma once

#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/scene.h"

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
  /// The fewest coordinates that do, static vectors included: with a correction if that takes fewer
  /// than `modes`, else these modes alone. Corrections of up to 30 coordinates are tried, above 8
  /// not with every number of them.
  Reduction fewest;
  double change = 0.0;  ///< with them [m]

  Eigen::Index coordinates() const { return fewest.machine.model.coordinates(); }
};

/// Tolerance [m] > 0. Throws ModelError where damping couples the modes, SimulationError where the
/// master cannot go on.
Accuracy find_accuracy(const Scene& scene, double tolerance, double duration,
                       const TrialLimits& limits);

}  // namespace sprag
