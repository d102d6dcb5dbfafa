// The largest disturbance at which V stays below the target.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/tolerance/bench.h"

namespace sprag::tolerance {

/// V of one estimator at one amount, over its runs.
struct Spread {
  double median = 0.0, low = 0.0, high = 0.0;
};

Spread spread_of(const std::vector<double>& values);

struct Point {
  double amount = 0.0;
  std::vector<Spread> V;  ///< of each estimator
  /// For each estimator: share in which its error is far above the replica's, mean over the runs
  /// (add_worse() of sprag/detail/study/trial.h). NaN for the replica, and if there is none.
  std::vector<double> worse;
};

/// The amount up to which the median of V stays below the target, interpolated linearly in the
/// logarithms of amounts and V.
struct Limit {
  enum class Kind { within, beyond_all, below_all, never };
  Kind kind = Kind::never;  ///< never: not even without deviation
  double amount = 0.0;      ///< the amount if `within`; else the largest or the least of the study
};

/// "within", "beyond_all", "below_all", "never".
const char* name(Limit::Kind kind);

struct Found {
  Deviation deviation;
  std::vector<Point> points;  ///< by amount
  std::vector<Limit> limits;  ///< of each estimator
  /// Limit for which the guaranteed bound of the replica stays below the target (guaranteed.h).
  /// Empty if the bound does not cover the deviation.
  std::optional<Limit> guaranteed = {};
};

struct Tolerances {
  Point undisturbed;
  std::vector<Found> found;
};

/// Runs the study. `progress` receives the round (of two) and the fraction of it that is done, from
/// one thread at a time. The result does not depend on the number of threads. Throws Interrupted.
Tolerances search(const Bench& bench, std::vector<Deviation> deviations, int threads,
                  const std::function<void(int round, double done)>& progress);

}  // namespace sprag::tolerance
