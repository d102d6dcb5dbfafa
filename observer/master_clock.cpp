#include "observer/master_clock.h"

#include <algorithm>
#include <cmath>

namespace sprag {
namespace {

constexpr std::int64_t window = 2'000'000'000;
constexpr std::int64_t largest_delay = 1'000'000;  // us

// Local time at which the message was sent, estimated from the wall clocks.
std::int64_t sent(const ContactMessage& message, const Arrival& arrival) {
  const std::int64_t late = delay(message.utime, arrival);
  return late >= 0 && late <= largest_delay ? arrival.monotonic - 1000 * late : arrival.monotonic;
}

}  // namespace

void MasterClock::observe(const ContactMessage& message, const Arrival& arrival) {
  const std::int64_t at = sent(message, arrival);
  const bool is_next = !received_ || message.sequence > last_number_;
  const bool set_back = received_ && is_next && message.horizon < last_horizon_;
  if (set_back) first_number_ = message.sequence;
  if (received_ && message.sequence < first_number_) return;
  if (is_next) {
    last_number_ = message.sequence;
    last_horizon_ = message.horizon;
  }
  if (!received_ || set_back || message.speed != speed_) {
    received_ = true;
    speed_ = message.speed;
    horizon_ = message.horizon;
    epoch_ = window_start_ = at;
    best_ = previous_best_ = message.horizon;
    return;
  }
  horizon_ = std::max(horizon_, message.horizon);
  if (std::isinf(speed_)) return;
  const double origin = message.horizon - speed_ * 1e-9 * static_cast<double>(at - epoch_);
  if (arrival.monotonic - window_start_ > window) {
    previous_best_ = best_;
    best_ = origin;
    window_start_ = arrival.monotonic;
  }
  best_ = std::max(best_, origin);
}

double MasterClock::origin() const { return std::max(best_, previous_best_); }

double MasterClock::simulated(std::int64_t local) const {
  if (std::isinf(speed_)) return horizon_;
  return origin() + speed_ * 1e-9 * static_cast<double>(local - epoch_);
}

std::int64_t MasterClock::local(double t) const {
  constexpr double longest = 1e18;  // ns, 30 years
  const double wait = std::ceil((t - origin()) / speed_ * 1e9);
  return epoch_ + static_cast<std::int64_t>(std::clamp(wait, -longest, longest));
}

}  // namespace sprag
