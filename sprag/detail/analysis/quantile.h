// Quantiles of measured values.
#pragma once

#include <vector>

namespace sprag {

/// The p-quantile of at least one value, p in [0, 1], linear between the values; infinity is a
/// value like any other.
double quantile(std::vector<double> values, double p);

}  // namespace sprag
