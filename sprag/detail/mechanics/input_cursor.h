// Follows a sampled input along a flight, from one knot to the next, forwards or backwards in time.
// It reads the samples of the input itself, so that it also follows a streamed one.
#pragma once

#include <cstddef>
#include <utility>

#include "sprag/sampled_input.h"

namespace sprag {

class InputCursor {
 public:
  explicit InputCursor(SampledInputPointer input) : input_(std::move(input)) {}

  /// Starts at time t. The input is multiplied by `gain` and `delay` later than the samples say
  /// [s].
  void start(double t, bool forwards, double gain, double delay);
  /// Time of the next knot on the way; infinite: none [s].
  double next() const;
  /// Continues on the polynomial after that knot, in the direction of the flight.
  void pass() { forwards_ ? ++interval_ : --interval_; }
  /// The input at time t, on the present polynomial.
  InputDerivatives at(double t) const;

 private:
  SampledInputPointer input_;
  std::size_t interval_ = 0;
  bool forwards_ = true;
  double gain_ = 1.0, delay_ = 0.0;
};

}  // namespace sprag
