// Runs an estimator through a complete record of events.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/scene.h"

namespace sprag {

/// Runs the estimator of a scene from tick 0 to the last tick at or before `end` [s], with the same
/// results as a live observer that receives these events in any order. Calls on_tick(state) at each
/// tick, in order. An adaptive estimator identifies the machine at once. Events that contradict
/// those before them are skipped (event_history.h). Throws Interrupted.
template <typename OnTick>
void drive(TrackingEstimator& estimator, const Scene& scene, std::span<const ContactEvent> events,
           double end, OnTick&& on_tick) {
  std::vector<ContactEvent> ordered(events.begin(), events.end());
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  TimeLine line(estimator, static_cast<int>(scene.model.contacts.size()), scene.prior.start, 1);
  line.restart(0, 0, 0, no_horizon);
  for (const ContactEvent& event : ordered) line.receive(event);
  line.set_horizon(end);
  const std::int64_t last = last_tick(end, estimator.h());
  AdaptationResult identified;
  line.run(
      0, [](const TrackingState&) {},
      [&](const TrackingState& state) {
        check_interrupt();
        on_tick(state);
        if (state.tick < last) identify_now(estimator, state, identified);
        return true;
      });
}

}  // namespace sprag
