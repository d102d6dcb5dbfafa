#include "tools/listen/arrival_scatter.h"

#include <algorithm>
#include <cmath>

namespace sprag {

namespace {

double middle(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

constexpr double sigma_per_deviation = 1.4826;  // median absolute deviation of a normal variable

}  // namespace

void ArrivalScatter::add_timed(double t, double arrival) {
  // The clocks may differ in offset and rate: a straight line is fitted.
  ++count_;
  const double lag = arrival - t;
  const double share = 1.0 / static_cast<double>(count_);
  const double from_t = t - mean_t_, from_lag = lag - mean_lag_;
  mean_t_ += share * from_t;
  mean_lag_ += share * from_lag;
  tt_ += from_t * (t - mean_t_);
  tl_ += from_t * (lag - mean_lag_);
  ll_ += from_lag * (lag - mean_lag_);
}

void ArrivalScatter::add_untimed(double arrival, bool repeats) {
  if (!repeats) {
    last_repeat_.reset();
    return;
  }
  if (last_repeat_ && intervals_.size() < most_intervals)
    intervals_.push_back(arrival - *last_repeat_);
  last_repeat_ = arrival;
}

double ArrivalScatter::residual_squares() const {
  return std::max(ll_ - (tt_ > 0.0 ? tl_ * tl_ / tt_ : 0.0), 0.0);
}

void ArrivalScatter::restart() {
  if (count_ > 2) {
    earlier_squares_ += residual_squares();
    earlier_freedom_ += count_ - 2;
    earlier_count_ += count_;
  }
  count_ = 0;
  mean_t_ = mean_lag_ = tt_ = tl_ = ll_ = 0.0;
  last_repeat_.reset();
}

std::optional<ArrivalScatter::Result> ArrivalScatter::result() const {
  const bool fits = count_ > 2;
  const std::size_t lines = earlier_count_ + (fits ? count_ : 0);
  if (lines >= fewest) {
    const double squares = earlier_squares_ + (fits ? residual_squares() : 0.0);
    const std::size_t freedom = earlier_freedom_ + (fits ? count_ - 2 : 0);
    return Result{std::sqrt(squares / static_cast<double>(freedom)), lines, true};
  }
  if (intervals_.size() < fewest) return std::nullopt;
  // An interval has the errors of two arrivals. Outliers, as of a line that is missing, do not
  // count.
  std::vector<double> deviations = intervals_;
  const double period = middle(intervals_);
  for (double& interval : deviations) interval = std::abs(interval - period);
  return Result{sigma_per_deviation * middle(deviations) / std::sqrt(2.0), intervals_.size(),
                false};
}

}  // namespace sprag
