// What a filter's standard deviations are held against: squares of errors over them, and what runs
// of many seeds come to. Pure functions of numbers.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace sprag::calibration {

/// Errors over the standard deviations that go with them. Where these are right the mean square is
/// 1, and 0.27 % lie beyond 3.
class NormalizedErrors {
 public:
  /// A deviation of +infinity says that nothing is known: it is counted and else left out. An error
  /// of nothing is right with any deviation.
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
  // Of the second half of the run.
  NormalizedErrors state;  ///< of q and u
  NormalizedErrors gaps;
  double V_replica = 0.0, V = 0.0;                  ///< medians
  double V_replica_largest = 0.0, V_largest = 0.0;  ///< +infinity: not a number
  double innovations = 0.0;                         ///< sum of their squares over their variances
  std::int64_t innovation_count = 0;
  // Of all of it.
  std::int64_t inconsistencies = 0;
  double from_filter = 0.0;  ///< share of the samples
  double worse = 0.0;        ///< share in which V is more than 10 times the replica's
};

/// What the trials of one machine and one jitter come to.
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

/// At least one trial.
Summary summarize(std::span<const Trial> trials);

/// The bars that a calibrated filter clears, by name, where it does not: the mean square ("z2"),
/// the share beyond 3 ("3s"), innovations ("J"), V against the replica's ("V", "Vmax"), numbers
/// ("nan"). `omega_sigma`: highest natural frequency times jitter; without one V is at rounding.
std::vector<std::string> missed_bars(const Summary& summary, double omega_sigma);

}  // namespace sprag::calibration
