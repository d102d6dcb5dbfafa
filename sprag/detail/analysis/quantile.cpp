#include "sprag/detail/analysis/quantile.h"

#include <algorithm>

namespace sprag {

double quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  const double place = p * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(below);
  if (part == 0.0) return values[below];
  // A weighted sum, since the difference of two infinite values is not a number.
  return (1.0 - part) * values[below] + part * values[below + 1];
}

}  // namespace sprag
