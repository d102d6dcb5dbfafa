#include "sprag/identification/drift.h"

#include <cmath>

#include "sprag/identification/linearized_filter.h"

namespace sprag {

std::optional<DriftEstimate> estimate_drift(const Scene& scene, const Identification& fit) {
  if (!is_near(fit) || fit.freedom <= 0) return std::nullopt;
  if (is_exact(fit)) return DriftEstimate{};
  constexpr double lowest = -6.0, highest = 5.0, step = 0.5;  // log10 of ratios
  constexpr double less = 1.92;
  const LinearizedFilter likelihood(scene, fit);
  if (!std::isfinite(likelihood.unit(1.0)) || !likelihood.follows_the_times()) return std::nullopt;
  const auto at = [&](double decade) { return likelihood.at(std::pow(10.0, decade)); };
  const LinearizedFilter::Value none = likelihood.at(0.0);
  double best = lowest;
  LinearizedFilter::Value value = at(best);
  for (double decade = lowest + step; decade <= highest; decade += step) {
    const LinearizedFilter::Value next = at(decade);
    if (next.log > value.log) {
      value = next;
      best = decade;
    }
  }
  for (double shorter = 0.5 * step; shorter > 0.01; shorter *= 0.5) {
    for (const double decade : {best - shorter, best + shorter}) {
      const LinearizedFilter::Value next = at(decade);
      if (next.log <= value.log) continue;
      value = next;
      best = decade;
      break;
    }
  }
  DriftEstimate estimate;
  const auto drift = [&](double decade, const LinearizedFilter::Value& of) {
    return std::pow(10.0, decade) * likelihood.unit(of.jitter);
  };
  const bool any = value.log > none.log;
  const double top = any ? value.log : none.log;
  if (any) {
    estimate.drift = drift(best, value);
    estimate.gain = 2.0 * (value.log - none.log);
  }
  estimate.jitter = any ? value.jitter : none.jitter;
  // Where it has fallen by `less`, to the left and to the right.
  const auto bound = [&](double outside) {
    double inside = best;
    for (int i = 0; i < 10; ++i) {
      const double middle = 0.5 * (inside + outside);
      (at(middle).log > top - less ? inside : outside) = middle;
    }
    return drift(inside, at(inside));
  };
  // What is not known of the jitter is not known of the drift either.
  const double of_jitter = likelihood.told() ? 1.0 : 1.0 + 1.96 * std::sqrt(2.0 / fit.freedom);
  if (none.log < top - less) estimate.low = bound(lowest - 1.0) / of_jitter;
  estimate.high = bound(highest + 1.0) * of_jitter;
  return estimate;
}

}  // namespace sprag
