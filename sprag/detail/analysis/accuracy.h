// Number of modes that an observer needs. The master of the whole machine generates the contact
// events, and a replica of the first modes alone follows them. It starts from the master's state,
// so its error comes from the omitted modes alone. The same is done with corrections for the
// omitted modes (reduction.h), which need fewer coordinates.
#pragma once

#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/scene.h"

namespace sprag {

struct Accuracy {
  double tolerance = 0.0;  ///< [m]
  double duration = 0.0;   ///< of the trial run [s]
  /// Smallest number of modes, by ascending frequency, with which the observed quantity stays
  /// within the tolerance of that of all modes, and stays so with more modes. The quantity is the
  /// tip of a beam, or the gaps of all contacts of another scene.
  int modes = 0;
  /// Largest change [m] with n modes, for n = modes - 1 (unless modes is 1), ..., all.
  struct Change {
    int modes;
    double change;
  };
  std::vector<Change> changes;
  /// The machine with the fewest coordinates within the tolerance, static vectors included. It has
  /// a correction if that needs fewer coordinates than `modes`, else these modes alone. Corrections
  /// are tried up to 30 coordinates, above 8 not for every number of them.
  Reduction fewest;
  double change = 0.0;  ///< largest change of `fewest` [m]

  Eigen::Index coordinates() const { return fewest.machine.model.coordinates(); }
};

/// Requires tolerance [m] > 0. Throws ModelError if damping couples the modes, SimulationError if
/// the master cannot continue.
Accuracy find_accuracy(const Scene& scene, double tolerance, double duration,
                       const TrialLimits& limits);

}  // namespace sprag
