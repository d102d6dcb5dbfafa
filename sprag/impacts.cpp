#include "sprag/impacts.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

void require_in_range(const char* name, double value, bool zero_too) {
  if (std::isfinite(value) && (value > 0.0 || (zero_too && value == 0.0))) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + "; must be " +
                              (zero_too ? ">= 0" : "> 0"));
}

// The events up to `end` in order of time, without those that contradict the events before them.
std::vector<ContactEvent> consistent(std::span<const ContactEvent> events, double end) {
  std::vector<ContactEvent> sorted;
  for (const ContactEvent& event : events) {
    if (event.t >= 0.0 && event.t <= end) sorted.push_back(event);
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  ContactSet chi = 0;
  std::erase_if(sorted, [&](const ContactEvent& event) {
    if (contains(chi, event.contact) != (event.kind == ContactEventKind::opens)) return true;
    chi = after(chi, event);
    return false;
  });
  return sorted;
}

// The state of the estimator at the last tick at or before `end`.
TrackingEstimator::State state_at(double end, const Scene& scene,
                                  std::span<const ContactEvent> events,
                                  TrackingEstimator& estimator) {
  TrackingEstimator::State state;
  estimator.start(scene.prior.start, 0, 0, state);
  std::size_t used = 0;
  const auto due = [&](std::int64_t k) {
    const std::size_t first = used;
    while (used < events.size() && first_tick_after(events[used].t, estimator.h()) <= k) ++used;
    return events.subspan(first, used - first);
  };
  for_each_instant(due(0),
                   [&](std::span<const ContactEvent> of_one) { estimator.apply(of_one, state); });
  AdaptationResult identified;
  const std::int64_t last = last_tick(end, estimator.h());
  while (state.tick < last) {
    check_interrupt();
    identify_now(estimator, state, identified);
    estimator.tick(due(state.tick + 1), state);
  }
  return state;
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
  state_at(duration + settings.tick, scene, consistent(events, duration), estimator);
  return records;
}

Prediction predict(const Scene& scene, std::span<const ContactEvent> events, double t, double ahead,
                   const ObserverSettings& settings, std::stop_token stop) {
  const StopScope scope(std::move(stop));
  require_in_range("t", t, true);
  require_in_range("ahead", ahead, false);
  TrackingEstimator estimator = estimator_of(scene, settings);
  const Predictor predictor(scene.model);
  const TrackingEstimator::State state = state_at(t, scene, consistent(events, t), estimator);
  return estimator.predict(state, predictor, ahead);
}

}  // namespace sprag
