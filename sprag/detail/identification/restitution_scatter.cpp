#include "sprag/detail/identification/restitution_scatter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/identification/departure.h"
#include "sprag/detail/identification/linearized_filter.h"

namespace sprag {

std::optional<RestitutionScatter> estimate_restitution_scatter(const Scene& scene,
                                                               const Identification& fit) {
  constexpr double lowest = 1e-6, highest = 0.1, factor = 2.0;
  constexpr double in_less_jitter = 100.0;
  const bool sought = std::any_of(fit.unknowns.begin(), fit.unknowns.end(), [](const auto& of) {
    return of.unknown.kind == Unknown::Kind::restitution;
  });
  if (!sought || !is_near(fit) || is_exact(fit) || fit.freedom <= 1) return std::nullopt;
  RestitutionScatter estimate;
  // Of the two linearizations, the one with the larger likelihood is nearer to the machine's path.
  double top = -std::numeric_limits<double>::infinity();
  using About = LinearizedFilter::About;
  for (const About about : {About::fit, About::measured_times}) {
    const LinearizedFilter filter(scene, fit, about);
    if (about == About::measured_times && !filter.meets_the_supports()) continue;
    const auto taken_up = static_cast<std::size_t>(filter.taken_up());
    const LinearizedFilter::Value none = filter.at(0.0);
    double best_of = 0.0;
    LinearizedFilter::Value best = none;
    const auto look_at = [&](double scatter) {
      const LinearizedFilter::Value next = filter.at(0.0, scatter);
      if (!(next.log > best.log)) return;
      best = next;
      best_of = scatter;
    };
    // With an unspecified jitter the scatter scales with it, so the search reaches farther.
    const double end = filter.jitter_given() ? highest : in_less_jitter * highest;
    for (double scatter = lowest; scatter < end; scatter *= factor) look_at(scatter);
    const double middle = best_of;
    for (const double share : {0.7, 0.85, 1.2, 1.4}) look_at(share * middle);
    if (!(best.log > top)) continue;
    top = best.log;
    const double gain = 2.0 * (best.log - none.log);
    const double of_jitter = best.jitter / filter.base();
    estimate = {best_of * of_jitter,
                best.jitter,
                gain,
                best.parameters,
                best.sigmas,
                correlation_of(best.innovations, taken_up),
                growth_of(best.innovations, taken_up)};
  }
  return estimate;
}

}  // namespace sprag
