#include "sprag/detail/filter/flux.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Beyond this argument the tail of the normal distribution is negligible or equals its asymptotic
// series to double precision.
constexpr double far = 8.0;

double normal_density(double x) { return std::exp(-0.5 * x * x - half_log_two_pi); }

}  // namespace

double normal_cdf(double x) { return 0.5 * std::erfc(-x * std::numbers::sqrt2 / 2.0); }

FluxMoments flux_moments(double mu, double d, double even) {
  const double a = -mu / d;
  const double share = even / d;
  if (a > far) {
    // gamma > 0 has negligible probability.
    const double all = a + share;
    return {std::log(d * all), mu - d / all, d * d * (1.0 - 1.0 / (all * all))};
  }
  // e_k = int y^k N(y; a, 1) dy over y = -gamma > 0, over phi(a); lengths in d.
  double e0, e1, e2, e3, log_density;
  if (a < -far) {
    // gamma < 0 is a far tail, concentrated near gamma = 0: asymptotic series.
    const double x = 1.0 / (a * a);
    e0 = -1.0 / a * (1.0 - x * (1.0 - x * (3.0 - 15.0 * x)));
    e1 = x * (1.0 - x * (3.0 - 15.0 * x));
    e2 = -2.0 / a * x * (1.0 - x * (6.0 - 45.0 * x));
    e3 = 6.0 * x * x * (1.0 - x * (10.0 - 105.0 * x));
    log_density = -0.5 * a * a - half_log_two_pi;
  } else {
    const double density = normal_density(a);
    e0 = normal_cdf(a) / density;
    e1 = 1.0 + a * e0;
    e2 = (1.0 + a * a) * e0 + a;
    e3 = (a * a * a + 3.0 * a) * e0 + a * a + 2.0;
    log_density = std::log(density);
  }
  const double total = e1 + share * e0;
  const double mean = (e2 + share * e1) / total;
  const double second = (e3 + share * e2) / total;
  return {std::log(d * total) + log_density, -d * mean,
          d * d * std::max(second - mean * mean, 0.0)};
}

}  // namespace sprag
