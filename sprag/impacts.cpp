#include "sprag/impacts.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>

#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/estimates/predictor.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/drive.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {
namespace {

void require_in_range(const char* name, double value, bool zero_too) {
  if (std::isfinite(value) && (value > 0.0 || (zero_too && value == 0.0))) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + "; must be " +
                              (zero_too ? ">= 0" : "> 0"));
}

std::vector<ContactEvent> up_to(double end, std::span<const ContactEvent> events) {
  std::vector<ContactEvent> before;
  std::copy_if(events.begin(), events.end(), std::back_inserter(before),
               [&](const ContactEvent& event) { return event.t <= end; });
  return before;
}

TrackingEstimator estimator_of(const Scene& scene, const ObserverSettings& settings) {
  require_in_range("tick", settings.tick, false);
  return {scene, settings.tick, settings.estimator};
}

}  // namespace

std::vector<ImpactRecord> impacts(const Scene& scene, std::span<const ContactEvent> events,
                                  double duration, const ObserverSettings& settings,
                                  std::stop_token stop) {
  const StopScope scope(std::move(stop));
  require_in_range("duration", duration, true);
  TrackingEstimator estimator = estimator_of(scene, settings);
  std::vector<ImpactRecord> records;
  estimator.record_in(records);
  // One tick more, since the last tick may precede the last events.
  drive(estimator, scene, up_to(duration, events), duration + settings.tick,
        [](const TrackingState&) {});
  return records;
}

Prediction predict(const Scene& scene, std::span<const ContactEvent> events, double t, double ahead,
                   const ObserverSettings& settings, std::stop_token stop) {
  const StopScope scope(std::move(stop));
  require_in_range("t", t, true);
  require_in_range("ahead", ahead, false);
  TrackingEstimator estimator = estimator_of(scene, settings);
  const Predictor predictor(scene.model);
  const std::int64_t last = last_tick(t, settings.tick);
  Prediction prediction;
  drive(estimator, scene, up_to(t, events), t, [&](const TrackingState& state) {
    if (state.tick == last) prediction = estimator.predict(state, predictor, ahead);
  });
  return prediction;
}

}  // namespace sprag
