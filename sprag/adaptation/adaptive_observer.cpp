#include "sprag/adaptation/adaptive_observer.h"

#include <memory>

#include "sprag/adaptation/adaptive_estimator.h"
#include "sprag/estimation/observer_core.h"

namespace sprag {

Observer adaptive_observer(const Scene& scene, double tick) {
  require_tick(tick);
  const auto result = std::make_shared<AdaptationResult>();
  return Observer(std::make_unique<ObserverCore<AdaptiveEstimator>>(
      scene, ObserverSettings{tick, EstimatorKind::adaptive}, infinity,
      [result](AdaptiveEstimator& estimator, const AdaptiveState& state) {
        identify_now(estimator, state, *result);
      }));
}

Observer make_observer(const Scene& scene, const ObserverSettings& settings) {
  const bool exact = settings.stepper == StepperKind::exact;
  if (exact && settings.estimator == EstimatorKind::adaptive) {
    return adaptive_observer(scene, settings.tick);
  }
  if (!exact || settings.estimator == EstimatorKind::replica || scene.parameters.empty()) {
    return Observer(scene, settings);
  }
  require_tick(settings.tick);
  return Observer(std::make_unique<ObserverCore<AdaptiveEstimator>>(
      scene, settings, initial_bound(scene), [](AdaptiveEstimator&, const AdaptiveState&) {}));
}

}  // namespace sprag
