// Compares the timing filter with the exact posterior (posterior.h), at the same instants of the
// same runs. The posterior starts from the filter's belief a number of impacts before. The
// difference is the cost of the filter's approximations; the posterior's sigma is the error that
// remains for any estimator.
#pragma once

#include "sprag/scene_file.h"
#include "studies/calibration/statistics.h"

namespace sprag::posterior {

struct Options {
  int seeds = 100;    ///< runs, with the events of seeds 1, 2, ... of the calibration study
  int instants = 10;  ///< in the second half of each run, further than 6 sigma from any event
  int window = 40;    ///< least number of impacts before each instant that are treated exactly
  int steps = 4000;   ///< of a random walk
  int threads = 2;
};

struct Comparison {
  int instants = 0;  ///< number of compared instants
  int skipped = 0;   ///< no window, or no posterior in it
  calibration::NormalizedErrors filter, exact;
  double sigma_ratio = 1.0;  ///< the filter's sigma over the exact one, geometric mean
  double mean_off = 0.0;     ///< difference of the means over the exact sigma: root mean square
};

/// jitter > 0 [s].
Comparison compare(const Scene& scene, double jitter, const Options& options);

}  // namespace sprag::posterior
