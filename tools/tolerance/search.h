// The largest disturbance at which V stays below the target.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/tolerance/bench.h"

namespace sprag::tolerance {

/// V that an amount leaves, of one estimator: of its runs.
struct Spread {
  double median = 0.0, low = 0.0, high = 0.0;
};

Spread spread_of(const std::vector<double>& values);

struct Point {
  double amount = 0.0;
  std::vector<Spread> V;  ///< of each estimator
  /// Of each estimator, the mean of the runs: how often it is far above the replica (add_worse() of
  /// tools/study/trial.h). NaN of the replica, and without it.
  std::vector<double> worse;
};

/// Up to which amount the median of V stays below the target; interpolated between the amounts that
/// were tried, linearly in their logarithms.
struct Limit {
  enum class Kind { within, beyond_all, below_all, never };
  Kind kind = Kind::never;  ///< never: not even where nothing is off
  double amount = 0.0;      ///< where it is within; else the last one tried, or the first
};

struct Found {
  Deviation deviation;
  std::vector<Point> points;  ///< by amount
  std::vector<Limit> limits;  ///< of each estimator
  /// Up to which the guaranteed bound of the replica stays below the target (guaranteed.h); none
  /// where the bound covers no such deviation.
  std::optional<Limit> guaranteed = {};
};

struct Tolerances {
  Point undisturbed;
  std::vector<Found> found;
};

/// `tell` is told of each of the two rounds and of how much of it is done, from 0 to 1, by one
/// thread at a time. The same for any number of threads. Throws Interrupted.
Tolerances search(const Bench& bench, std::vector<Deviation> deviations, int threads,
                  const std::function<void(int round, double done)>& tell);

}  // namespace sprag::tolerance
