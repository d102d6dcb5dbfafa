#include "observer/master_clock.h"

#include <algorithm>
#include <cmath>

namespace sprag {
namespace {

constexpr std::int64_t window = 2'000'000'000;

}  // namespace

void MasterClock::observe(const ContactReport& report, std::int64_t arrival) {
  if (!heard_ || report.speed != speed_) {
    heard_ = true;
    speed_ = report.speed;
    horizon_ = report.horizon;
    epoch_ = window_start_ = arrival;
    best_ = previous_best_ = report.horizon;
    return;
  }
  horizon_ = std::max(horizon_, report.horizon);
  if (std::isinf(speed_)) return;
  const double origin = report.horizon - speed_ * 1e-9 * static_cast<double>(arrival - epoch_);
  if (arrival - window_start_ > window) {
    previous_best_ = best_;
    best_ = origin;
    window_start_ = arrival;
  }
  best_ = std::max(best_, origin);
}

double MasterClock::origin() const { return std::max(best_, previous_best_); }

double MasterClock::simulated(std::int64_t local) const {
  if (std::isinf(speed_)) return horizon_;
  return origin() + speed_ * 1e-9 * static_cast<double>(local - epoch_);
}

std::int64_t MasterClock::local(double t) const {
  return epoch_ + static_cast<std::int64_t>(std::ceil((t - origin()) / speed_ * 1e9));
}

}  // namespace sprag
