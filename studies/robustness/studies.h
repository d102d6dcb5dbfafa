// The studies of docs/robustness.md: what is varied, how far, and what comes out of it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "studies/robustness/disturbance.h"
#include "studies/robustness/run.h"
#include "studies/robustness/statistics.h"

namespace sprag::robustness {

/// What becomes of one run.
struct Setting {
  Scene believed;
  Disturbance disturbance;
};

struct Study {
  std::string name;
  int modes = 3;                ///< of the master
  int most_runs = 0;            ///< fewer than Options has, where they are dear
  bool power_law = true;        ///< V may be one of the amount
  std::vector<double> amounts;  ///< ascending, the first 0: nothing is varied
  std::vector<Method> methods;  ///< the first is the replica
  /// `sign` is +-1, for what can be off both ways.
  std::function<Setting(double amount, double sign)> setting;
};

/// `scene` is the paper's beam.
std::vector<Study> studies(const Scene& scene);

/// Standard deviation of the event times in all studies but that of the jitter itself [s].
inline constexpr double usual_jitter = 1e-4;

/// V of one amount; the floor of a run is the median of V over the second half of it.
struct Point {
  double amount = 0.0;
  std::vector<std::vector<double>> floors;  ///< [method][run]
  /// [method]: share of the samples of all runs in which V is more than 10 times the replica's, and
  /// above 1e-20, where rounding is.
  std::vector<double> share_worse;

  double median(std::size_t method) const { return quantile(floors[method], 0.5); }
};

struct Options {
  Sampling sampling;
  int runs = 50;  ///< seeds 1, 2, ...
  int threads = 2;
};

/// One point for each amount, of min(options.runs, study.most_runs) runs. `progress` is called, by
/// any thread but one at a time, after each run of all methods. Throws what a simulation throws.
std::vector<Point> measure(const Study& study, const Scene& scene, const Options& options,
                           const std::function<void()>& progress);

/// V over the amount where it may be a power law: above ten times what it is at amount 0, below
/// 1e-3, above rounding.
struct Slope {
  PowerLaw law;
  int points = 0;  ///< fewer than three: there is no law
  double from = 0.0, to = 0.0;
};
Slope slope(const Study& study, const std::vector<Point>& points, std::size_t method);

/// The largest amount up to which the median of V stays below 1e-4.
Threshold tolerance(const std::vector<Point>& points, std::size_t method);
inline constexpr double tolerable = 1e-4;

}  // namespace sprag::robustness
