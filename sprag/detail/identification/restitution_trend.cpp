#include "sprag/detail/identification/restitution_trend.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/identification/linearized_filter.h"

namespace sprag {

std::optional<RestitutionTrend> estimate_restitution_trend(const Scene& scene,
                                                           const Identification& fit,
                                                           const Departure& beside) {
  const bool sought = std::any_of(fit.unknowns.begin(), fit.unknowns.end(), [](const auto& of) {
    return of.unknown.kind == Unknown::Kind::restitution;
  });
  if (!sought || !is_near(fit) || is_exact(fit) || fit.freedom <= 1) return std::nullopt;
  LinearizedFilter filter(scene, fit, LinearizedFilter::About::fit);
  double ratio = 0.0, scatter = 0.0;  // of the filter's run with the jitter base()
  if (beside.is_drift()) ratio = beside.drift->drift / filter.unit(beside.drift->jitter);
  if (beside.is_scatter()) {
    scatter = beside.scatter->scatter * filter.base() / beside.scatter->jitter;
  }
  RestitutionTrend trend;
  trend.chi2_without = filter.at(ratio, scatter).chi2;
  filter.add_restitution_trend();
  const LinearizedFilter::Value value = filter.at(ratio, scatter);
  trend.chi2_with = value.chi2;
  trend.gain = filter.jitter_given() ? trend.chi2_without - trend.chi2_with
                                     : fit.freedom * std::log(trend.chi2_without / trend.chi2_with);
  trend.trend = value.parameters[value.parameters.size() - 1];
  trend.sigma = value.sigmas[value.sigmas.size() - 1];
  return trend;
}

}  // namespace sprag
