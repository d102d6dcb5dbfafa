// Quantiles of measured values.
#pragma once

#include <vector>

namespace sprag::common {

/// The p-quantile, p in [0, 1], linear between the values; +infinity is a value like any other.
double quantile(std::vector<double> values, double p);

}  // namespace sprag::common
