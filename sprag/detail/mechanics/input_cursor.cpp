#include "sprag/detail/mechanics/input_cursor.h"

#include <limits>

namespace sprag {

void InputCursor::start(double t, bool forwards, double gain, double delay) {
  forwards_ = forwards;
  gain_ = gain;
  delay_ = delay;
  interval_ = input_->interval(t - delay);
  // At a knot, the way back begins on the polynomial before it.
  if (!forwards && interval_ > 0 && !(next() < t)) --interval_;
  if (forwards && !(next() > t)) ++interval_;
}

double InputCursor::next() const {
  constexpr double none = std::numeric_limits<double>::infinity();
  if (!forwards_) return interval_ > 0 ? input_->knots()[interval_] + delay_ : -none;
  return interval_ + 1 < input_->knots().size() ? input_->knots()[interval_ + 1] + delay_ : none;
}

InputDerivatives InputCursor::at(double t) const {
  InputDerivatives d = input_->derivatives(interval_, t - delay_ - input_->knots()[interval_]);
  for (double& of : d) of *= gain_;
  return d;
}

}  // namespace sprag
