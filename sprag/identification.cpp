#include "sprag/identification.h"

#include "sprag/detail/identification/fit.h"
#include "sprag/detail/identification/fitted_scene.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {

void FittedUnknown::widen(double to) {
  if (!(to > sigma)) return;
  const double wider = 1.96 * (to - sigma);
  sigma = to;
  low -= wider;
  high += wider;
}

Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings, std::stop_token stop) {
  const StopScope scope(std::move(stop));
  IdentificationSettings determinable = settings;
  std::vector<ClockAmbiguity> ambiguities;
  std::vector<FittedUnknown> held;
  std::erase_if(determinable.unknowns, [&](const Parameter& unknown) {
    const auto ambiguity = clock_ambiguity(scene, settings.unknowns, unknown);
    if (!ambiguity) return false;
    ambiguities.push_back(*ambiguity);
    held.push_back({.unknown = unknown, .value = unknown.nominal, .determined = false});
    return true;
  });
  Identification result = fit_events(scene, events, determinable).result;
  result.ambiguities = std::move(ambiguities);
  result.unknowns.insert(result.unknowns.end(), held.begin(), held.end());
  if (result.converged()) result.fitted = fitted_scene(scene, result);
  return result;
}

}  // namespace sprag
