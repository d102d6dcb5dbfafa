// The timing filter beside the exact posterior (posterior.h) from what it believed so many impacts
// before, at the same instants of the same runs: what its approximations cost, and what no mean and
// deviation could tell better.
#pragma once

#include "sprag/scene_file.h"
#include "studies/calibration/statistics.h"

namespace sprag::posterior {

struct Options {
  int seeds = 100;    ///< runs, with the events of seeds 1, 2, ... of the calibration study
  int instants = 10;  ///< in the second half of each, further than 6 sigma from any event
  int window = 40;    ///< impacts before each, at least, that are taken exactly
  int steps = 4000;   ///< of a walk
  int threads = 2;
};

struct Comparison {
  int instants = 0;  ///< that were compared
  int skipped = 0;   ///< no window, or no posterior in it
  calibration::NormalizedErrors filter, exact;
  double sigma_ratio = 1.0;  ///< the filter's sigma over the exact one, geometric mean
  double mean_off = 0.0;     ///< between the means, over the exact sigma: root mean square
};

/// jitter > 0 [s].
Comparison compare(const Scene& scene, double jitter, const Options& options);

}  // namespace sprag::posterior
