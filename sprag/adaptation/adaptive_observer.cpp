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

}  // namespace sprag
