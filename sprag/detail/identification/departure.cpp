#include "sprag/detail/identification/departure.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/identification/drift.h"
#include "sprag/detail/identification/linearized_filter.h"
#include "sprag/detail/identification/restitution_scatter.h"
#include "sprag/detail/identification/restitution_trend.h"

namespace sprag {
namespace {

template <typename Error>
double gain_of(const std::optional<Error>& error) {
  return error && error->found() ? error->gain : 0.0;
}

}  // namespace

// A scatter of the restitution is preferred unless another kind has a significantly larger gain.
bool Departure::is_scatter() const {
  const double others = std::max(gain_of(drift), gain_of(trend));
  return scatter && scatter->found() && scatter->gain > others - significant_departure;
}

bool Departure::is_drift() const {
  return !is_scatter() && drift && drift->found() && drift->gain >= gain_of(trend);
}

bool Departure::is_trend() const {
  return !is_scatter() && trend && trend->found() && trend->gain > gain_of(drift);
}

bool Departure::is_structured() const {
  constexpr double white = 6.0;
  if (is_drift() || is_trend()) return true;
  return (is_scatter() ? scatter->correlation : correlation) > white;
}

double correlation_of(const std::vector<double>& innovations, std::size_t first) {
  constexpr std::size_t most_lags = 16, least = 12;
  if (innovations.size() < first + least) return 0.0;
  const std::size_t n = innovations.size() - first, lags = std::min(most_lags, n / 4);
  const double* e = innovations.data() + first;
  double squares = 0.0;
  for (std::size_t k = 0; k < n; ++k) squares += e[k] * e[k];
  double Q = 0.0;
  for (std::size_t lag = 1; lag <= lags; ++lag) {
    double product = 0.0;
    for (std::size_t k = lag; k < n; ++k) product += e[k] * e[k - lag];
    Q += product * product / (squares * squares) / static_cast<double>(n - lag);
  }
  Q *= static_cast<double>(n * (n + 2));
  const auto L = static_cast<double>(lags);
  return (Q - L) / std::sqrt(2.0 * L);
}

double growth_of(const std::vector<double>& innovations, std::size_t first) {
  const std::size_t n = innovations.size(), split = n - n / 5;
  if (split <= first || split == n) return 1.0;
  const auto mean_square = [&](std::size_t from, std::size_t to) {
    double squares = 0.0;
    for (std::size_t k = from; k < to; ++k) squares += innovations[k] * innovations[k];
    return squares / static_cast<double>(to - from);
  };
  return mean_square(split, n) / mean_square(first, split);
}

Departure estimate_departure(const Scene& scene, const Identification& fit) {
  Departure departure;
  departure.drift = estimate_drift(scene, fit);
  departure.scatter = estimate_restitution_scatter(scene, fit);
  departure.trend = estimate_restitution_trend(scene, fit);
  departure.trend_beside = departure.trend;
  if (departure.is_drift() || departure.is_scatter()) {
    departure.trend_beside = estimate_restitution_trend(scene, fit, departure);
  }
  if (is_near(fit) && !is_exact(fit) && fit.freedom > 0) {
    const LinearizedFilter filter(scene, fit, LinearizedFilter::About::fit);
    departure.correlation =
        correlation_of(filter.at(0.0).innovations, static_cast<std::size_t>(filter.taken_up()));
  }
  return departure;
}

void include(const Departure& error, Identification& fit) {
  if (!error.is_drift() && !error.is_scatter()) return;
  const Eigen::VectorXd& changes = error.is_drift() ? error.drift->changes : error.scatter->changes;
  const Eigen::VectorXd& sigmas = error.is_drift() ? error.drift->sigmas : error.scatter->sigmas;
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    FittedUnknown& fitted = fit.unknowns[k];
    if (i >= sigmas.size() || !std::isfinite(sigmas[i])) continue;
    // The fit's value differs from the most likely one with the error, by `changes`.
    const double sigma =
        std::hypot(sigmas[i], changes[i]) * std::abs(fitted.unknown.slope(fitted.value));
    if (!(sigma > fitted.sigma)) continue;
    const double wider = 1.96 * (sigma - fitted.sigma);
    fitted.sigma = sigma;
    fitted.low -= wider;
    fitted.high += wider;
  }
}

}  // namespace sprag
