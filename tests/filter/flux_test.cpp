// Moments of a gap velocity weighted by its flux, against quadrature.
#include "sprag/detail/filter/flux.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace sprag {
namespace {

TEST(FluxMoments, EqualQuadrature) {
  for (const double even : {0.0, 0.3, 20.0}) {
    for (const double mu : {-30.0, -9.0, -7.0, -1.0, 0.0, 2.0, 7.0, 12.0}) {
      constexpr double d = 1.5;
      // The integrand relative to its value at gamma = 0 or at its peak, in steps of d / 4000.
      const double scale = mu < 0.0 ? 0.0 : -0.5 * mu * mu / (d * d);
      double weight = 0.0, first = 0.0, second = 0.0;
      constexpr double step = d / 4000.0;
      for (double gamma = -0.5 * step; gamma > std::min(mu, 0.0) - 14.0 * d; gamma -= step) {
        const double off = (gamma - mu) / d;
        const double w = (-gamma + even) * std::exp(-0.5 * off * off - scale);
        weight += w;
        first += w * gamma;
        second += w * gamma * gamma;
      }
      const double mean = first / weight;
      const FluxMoments moments = flux_moments(mu, d, even);
      const double log_weight =
          std::log(weight * step / d) + scale - 0.91893853320467274;  // log sqrt(2 pi)
      EXPECT_NEAR(moments.log_weight, log_weight, 1e-4) << mu << ' ' << even;
      EXPECT_NEAR(moments.mean, mean, 1e-3 * std::abs(mean)) << mu << ' ' << even;
      const double variance = second / weight - mean * mean;
      EXPECT_NEAR(moments.variance, variance, 5e-3 * variance) << mu << ' ' << even;
    }
  }
}

}  // namespace
}  // namespace sprag
