// Numbers the samples of an input by their times: sample k has the time t0 + k dt, where t0 is the
// time of the first one.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace sprag {

class InputGrid {
 public:
  /// A sample whose time is off its place by more than this share of dt is refused: at that place
  /// its value would be another input.
  static constexpr double largest_shift = 0.1;

  /// `dt`: interval between samples [s], > 0.
  explicit InputGrid(double dt) : dt_(dt) {}

  struct Place {
    std::int64_t k = 0;        ///< number of the sample
    std::int64_t missing = 0;  ///< samples between the last one and this one
    std::string problem;       ///< why there is no place; empty: there is one
  };

  /// The place of a sample of time t [s], which is taken unless there is a problem.
  Place take(double t);

  /// The next sample is the first one.
  void restart() { t0_.reset(); }

  /// Time of the first sample [s]; none: there is no sample.
  const std::optional<double>& t0() const { return t0_; }
  double dt() const { return dt_; }

 private:
  double dt_;
  std::optional<double> t0_;
  std::int64_t next_ = 0;
};

}  // namespace sprag
