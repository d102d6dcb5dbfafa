// Quantiles of samples.
#pragma once

#include <vector>

namespace sprag {

/// The p-quantile of at least one value, p in [0, 1], linear between the values. Values may be
/// infinite.
double quantile(std::vector<double> values, double p);

}  // namespace sprag
