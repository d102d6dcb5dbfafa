#include "sprag/detail/events/input_history.h"

#include <algorithm>
#include <cmath>

namespace sprag {

void InputHistory::restart() {
  input_->clear(of_record_);
  next_ = 0;
}

bool InputHistory::append(double value) {
  const double dt = input_->spacing();
  if (!input_->append(std::fma(static_cast<double>(next_), dt, t0_), value)) {
    ++counts_.no_room;
    return false;
  }
  last_ = value;
  ++next_;
  return true;
}

InputHistory::Taken InputHistory::take(const InputMessage& message) {
  ++counts_.messages;
  const double dt = message.dt;
  const bool belongs =
      started() ? dt == input_->spacing() && message.t0 == t0_
                : std::abs(dt - of_record_) <= SampledInput::largest_rate_error * of_record_;
  if (!belongs) {
    ++counts_.refused;
    return {};
  }
  Taken taken;
  if (!started()) {
    input_->clear(dt);
    t0_ = message.t0;
    next_ = message.first();
    taken.any = append(message.sample(next_));
    if (!taken.any) return taken;
    ++counts_.samples;
  }
  taken.from = newest();
  if (message.first() > next_) {
    ++counts_.gaps;
    taken.gap_from = newest();
    const double before = last_, after = message.sample(message.first());
    const auto missing = static_cast<double>(message.first() - next_ + 1);
    for (double k = 1.0; next_ < message.first(); ++k) {
      if (!append(before + (after - before) * (k / missing))) return taken;
      ++counts_.filled;
      taken.any = true;
    }
    taken.gap_to = newest() + dt;
  }
  while (next_ < message.total && append(message.sample(next_))) {
    ++counts_.samples;
    taken.any = true;
  }
  return taken;
}

}  // namespace sprag
