// Statistics of a filter's calibration: normalized errors squared, and their summary over the runs
// of many seeds. Pure functions of numbers.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace sprag::calibration {

/// Errors over their claimed standard deviations. For calibrated deviations the mean square is 1,
/// and 0.27 % lie beyond 3.
class NormalizedErrors {
 public:
  /// A deviation of +infinity claims nothing: it is counted as unknown and otherwise left out. An
  /// error of zero is consistent with any deviation.
  void add(double error, double deviation);
  void add(const NormalizedErrors& others);

  std::int64_t count() const { return count_; }      ///< with a deviation
  std::int64_t unknown() const { return unknown_; }  ///< without one
  std::int64_t not_numbers() const { return not_numbers_; }
  double mean_square() const;  ///< NaN without any
  double beyond() const;       ///< share beyond 3; NaN without any

 private:
  std::int64_t count_ = 0, unknown_ = 0, not_numbers_ = 0, beyond_ = 0;
  double sum_ = 0.0;
};

/// One run of one seed.
struct Trial {
  // Over the second half of the run.
  NormalizedErrors state;  ///< of q and u
  NormalizedErrors gaps;
  double V_replica = 0.0, V = 0.0;                  ///< medians
  double V_replica_largest = 0.0, V_largest = 0.0;  ///< +infinity: not a number
  double innovations = 0.0;                         ///< sum of their squares over their variances
  std::int64_t innovation_count = 0;
  // Over the whole run.
  std::int64_t inconsistencies = 0;
  double from_filter = 0.0;  ///< share of the samples
  double worse = 0.0;  ///< share of the samples in which V is more than 10 times the replica's
};

/// Summary of the trials of one machine and one jitter.
struct Summary {
  NormalizedErrors state, gaps;
  double deviation = 0.0;           ///< standard deviation of the mean square of `state`, by trials
  double V_replica = 0.0, V = 0.0;  ///< medians of the trials' medians
  double V_replica_largest = 0.0, V_largest = 0.0;
  double J = 0.0;  ///< mean square of innovations over their variances; NaN without any
  std::int64_t inconsistencies = 0;
  double from_filter = 0.0;
  double worse = 0.0;          ///< mean of the trials
  double worse_largest = 0.0;  ///< of one trial
};

/// Requires at least one trial.
Summary summarize(std::span<const Trial> trials);

/// Names of the criteria of a calibrated filter that the summary does not meet: the mean square
/// ("z2"), the share beyond 3 ("3s"), innovations ("J"), V against the replica's ("V", "Vmax"), not
/// a number ("nan"). `omega_sigma`: highest natural frequency times jitter; without jitter V is at
/// the rounding level.
std::vector<std::string> missed_bars(const Summary& summary, double omega_sigma);

}  // namespace sprag::calibration
