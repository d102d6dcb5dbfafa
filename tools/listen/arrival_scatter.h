// How much the times of arrival of lines scatter, which is the jitter of edges that are stamped on
// arrival. Two measures: against the device's own times, if lines have them; else from the
// intervals of lines that repeat a level, which a device prints at a fixed period.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sprag {

class ArrivalScatter {
 public:
  /// A line with the device's time `t` arrived at `arrival` [s].
  void add_timed(double t, double arrival);

  /// A line arrived; `repeats`: it repeats the level of all its contacts.
  void add_untimed(double arrival, bool repeats);

  /// The device was restarted or connected again: its clock is another one.
  void restart();

  struct Result {
    double sigma = 0.0;  ///< standard deviation of a time of arrival [s]
    std::size_t lines = 0;
    bool timed = false;  ///< against the device's times
  };

  /// Nullopt: too few lines.
  std::optional<Result> result() const;

  static constexpr std::size_t fewest = 20;

 private:
  static constexpr std::size_t most_intervals = 4096;

  // Sums about the means, of arrival - t over t, by Welford's method; and those of earlier devices.
  std::size_t count_ = 0;
  double mean_t_ = 0.0, mean_lag_ = 0.0;
  double tt_ = 0.0, tl_ = 0.0, ll_ = 0.0;
  std::size_t earlier_count_ = 0, earlier_freedom_ = 0;
  double earlier_squares_ = 0.0;

  double residual_squares() const;

  std::optional<double> last_repeat_;
  std::vector<double> intervals_;
};

}  // namespace sprag
