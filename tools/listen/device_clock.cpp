#include "tools/listen/device_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sprag {

namespace {

constexpr double none_yet = -std::numeric_limits<double>::infinity();

/// The whole number that `value` is; nullopt if it has a fraction.
std::optional<Decimal::Integer> whole(Decimal value) {
  for (; value.exponent > 0; --value.exponent) {
    if (__builtin_mul_overflow(value.mantissa, 10, &value.mantissa)) return std::nullopt;
  }
  for (; value.exponent < 0 && value.mantissa % 10 == 0 && value.mantissa != 0; ++value.exponent)
    value.mantissa /= 10;
  if (value.exponent < 0 && value.mantissa != 0) return std::nullopt;
  return value.mantissa;
}

}  // namespace

double DeviceClock::to_seconds(const Decimal& value, bool clock) const {
  return difference_in(value, options_.offset, clock ? Decimal{1, 0} : unit()) / options_.rate;
}

std::optional<double> DeviceClock::now(double arrival) const {
  if (!last_t_ || std::isinf(options_.speed)) return std::nullopt;
  return std::max(best_, previous_best_) + options_.speed * arrival;
}

DeviceClock::Order DeviceClock::order_of(double t, double arrival) const {
  if (!last_t_) return Order::follows;
  if (t < *last_t_) return Order::falls;
  const auto present = now(arrival);
  return present && t > *present + options_.speed * options_.latency ? Order::leaps
                                                                     : Order::follows;
}

DeviceClock::Reading DeviceClock::read(const ClockTime& time, double arrival) const {
  Reading result;
  const bool clock = time.kind != ClockTime::Kind::number;
  Decimal value = time.value;
  if (time.kind == ClockTime::Kind::time_of_day)
    value = after_midnight(value, last_t_ ? last_value_ : options_.offset);
  if (options_.counter_bits == 0) {
    result.t = to_seconds(value, clock);
    result.order = order_of(result.t, arrival);
    result.value = value;
    if (!std::isfinite(result.t)) result.problem = "the time is too large";
    return result;
  }

  const Decimal::Integer size = Decimal::Integer{1} << options_.counter_bits;
  const auto count = clock ? std::nullopt : whole(value);
  if (!count || *count < 0 || *count >= size) {
    result.problem = "the time is no count of " + std::to_string(options_.counter_bits) + " bits";
    return result;
  }
  const auto at_lap = [&](Decimal::Integer lap) {
    Reading reading;
    reading.value = {*count + lap * size, 0};
    reading.t = to_seconds(reading.value, false);
    reading.order = order_of(reading.t, arrival);
    return reading;
  };
  result = at_lap(laps_);
  if (!last_t_) return result;
  const Decimal::Integer step = result.value.mantissa - last_value_.mantissa;
  if (step < 0 && step + size < size / 2) {
    // A wrap or a restart. After a wrap the time is not in the future.
    Reading wrapped = at_lap(laps_ + 1);
    wrapped.wraps = true;
    if (wrapped.order == Order::follows) return wrapped;
  } else if (step > size / 2 && laps_ > 0) {
    return at_lap(laps_ - 1);  // an edge from before the last wrap, which is late
  }
  return result;
}

void DeviceClock::accept(const Reading& reading, double arrival) {
  if (reading.wraps) ++laps_;
  last_value_ = reading.value;
  if (!std::isinf(options_.speed)) {
    const double origin = reading.t - options_.speed * arrival;
    if (!last_t_) {
      best_ = origin;
      previous_best_ = none_yet;
      window_start_ = arrival;
    } else if (arrival - window_start_ > window) {
      previous_best_ = best_;
      best_ = origin;
      window_start_ = arrival;
    }
    best_ = std::max(best_, origin);
  }
  last_t_ = reading.t;
}

void DeviceClock::restart() {
  last_t_.reset();
  laps_ = 0;
  options_.offset = {0, 0};
}

}  // namespace sprag
