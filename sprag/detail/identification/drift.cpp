#include "sprag/detail/identification/drift.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/identification/linearized_filter.h"

namespace sprag {
namespace {

constexpr double lowest = -6.0, highest = 5.0, step = 0.5;  // log10 of ratios

struct Best {
  double decade = lowest;
  LinearizedFilter::Value none, value;  // without a drift, and with the most likely one

  double top() const { return std::max(none.log, value.log); }
};

LinearizedFilter::Value value_at(const LinearizedFilter& likelihood, double decade) {
  return likelihood.at(std::pow(10.0, decade));
}

Best most_likely(const LinearizedFilter& likelihood) {
  Best best{lowest, likelihood.at(0.0), value_at(likelihood, lowest)};
  const auto look_at = [&](double decade) {
    const LinearizedFilter::Value next = value_at(likelihood, decade);
    if (!(next.log > best.value.log)) return false;
    best.value = next;
    best.decade = decade;
    return true;
  };
  for (double decade = lowest + step; decade <= highest; decade += step) look_at(decade);
  for (double shorter = 0.5 * step; shorter > 0.01; shorter *= 0.5) {
    const double middle = best.decade;
    if (!look_at(middle - shorter)) look_at(middle + shorter);
  }
  return best;
}

}  // namespace

std::optional<DriftEstimate> estimate_drift(const Scene& scene, const Identification& fit) {
  if (!is_near(fit) || fit.freedom <= 0) return std::nullopt;
  if (is_exact(fit)) return DriftEstimate{};
  constexpr double less = 1.92;
  using About = LinearizedFilter::About;
  const LinearizedFilter about_fit(scene, fit, About::fit);
  const LinearizedFilter about_times(scene, fit, About::measured_times);
  if (!std::isfinite(about_fit.unit(1.0))) return std::nullopt;
  // Of the two linearizations, the one with the larger likelihood is nearer to the machine's path.
  const LinearizedFilter* likelihood = &about_fit;
  Best best = most_likely(about_fit);
  if (about_times.meets_the_supports()) {
    const Best other = most_likely(about_times);
    if (other.top() > best.top()) {
      best = other;
      likelihood = &about_times;
    }
  }
  DriftEstimate estimate;
  const auto drift = [&](double decade, const LinearizedFilter::Value& of) {
    return std::pow(10.0, decade) * likelihood->unit(of.jitter);
  };
  const bool any = best.value.log > best.none.log;
  if (any) {
    estimate.drift = drift(best.decade, best.value);
    estimate.gain = 2.0 * (best.value.log - best.none.log);
  }
  const LinearizedFilter::Value& with = any ? best.value : best.none;
  estimate.jitter = with.jitter;
  estimate.changes = with.parameters;
  estimate.sigmas = with.sigmas;
  // Drift at which the likelihood has fallen by `less`, towards `outside`.
  const auto bound = [&](double outside) {
    double inside = best.decade;
    for (int i = 0; i < 10; ++i) {
      const double middle = 0.5 * (inside + outside);
      (value_at(*likelihood, middle).log > best.top() - less ? inside : outside) = middle;
    }
    return drift(inside, value_at(*likelihood, inside));
  };
  // An estimated jitter adds its own uncertainty to the drift's.
  const double of_jitter =
      likelihood->jitter_given() ? 1.0 : 1.0 + 1.96 * std::sqrt(2.0 / fit.freedom);
  if (best.none.log < best.top() - less) estimate.low = bound(lowest - 1.0) / of_jitter;
  estimate.high = bound(highest + 1.0) * of_jitter;
  return estimate;
}

}  // namespace sprag
