// Quantiles, power laws and thresholds of measured points.
#pragma once

#include <span>
#include <vector>

namespace sprag::robustness {

/// The p-quantile, p in [0, 1], linear between the values; +infinity is a value like any other.
double quantile(std::vector<double> values, double p);

/// y = factor x^exponent, least squares in the logarithms.
struct PowerLaw {
  double exponent = 0.0;
  double factor = 0.0;
  double off = 1.0;  ///< largest ratio between a y and the law
};

/// At least two points, x and y > 0, not all x equal.
PowerLaw fit_power_law(std::span<const double> x, std::span<const double> y);

/// Up to which x the values stay below a limit.
struct Threshold {
  double x = 0.0;       ///< 0: they never are
  bool beyond = false;  ///< they still are at the last x, which this is
};

/// The first crossing, interpolated in the logarithms. x ascending, > 0.
Threshold stays_below(double limit, std::span<const double> x, std::span<const double> y);

}  // namespace sprag::robustness
