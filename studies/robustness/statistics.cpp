#include "studies/robustness/statistics.h"

#include <algorithm>
#include <cmath>

namespace sprag::robustness {

double quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  const double place = p * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(below);
  if (part == 0.0 || values[below] == values[below + 1]) return values[below];
  return values[below] + part * (values[below + 1] - values[below]);
}

PowerLaw fit_power_law(std::span<const double> x, std::span<const double> y) {
  const auto n = static_cast<double>(x.size());
  double x_mean = 0.0;
  double y_mean = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    x_mean += std::log(x[i]) / n;
    y_mean += std::log(y[i]) / n;
  }
  double xy = 0.0;
  double xx = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = std::log(x[i]) - x_mean;
    xy += dx * (std::log(y[i]) - y_mean);
    xx += dx * dx;
  }
  PowerLaw law{xy / xx, std::exp(y_mean - xy / xx * x_mean), 1.0};
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double ratio = y[i] / (law.factor * std::pow(x[i], law.exponent));
    law.off = std::max({law.off, ratio, 1.0 / ratio});
  }
  return law;
}

Threshold stays_below(double limit, std::span<const double> x, std::span<const double> y) {
  if (!(y[0] < limit)) return {};
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (y[i] < limit) continue;
    if (!std::isfinite(y[i]) || !(y[i - 1] > 0.0)) return {x[i - 1], false};
    const double part = std::log(limit / y[i - 1]) / std::log(y[i] / y[i - 1]);
    return {x[i - 1] * std::pow(x[i] / x[i - 1], part), false};
  }
  return {x.back(), true};
}

}  // namespace sprag::robustness
