// Runs an estimator through the events of a time line, or through a complete record of events.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/scene.h"

namespace sprag {

/// Settles the known ticks of a time line, at most `budget` ones. Calls on_settled(state) at each,
/// as TimeLine::run() does. An adaptive estimator identifies the machine at once where a tick up to
/// `last` depends on it. Returns whether all of them have settled. Throws Interrupted.
template <typename OnSettled>
bool settle(TimeLine& line, std::int64_t last, OnSettled&& on_settled,
            std::int64_t budget = std::numeric_limits<std::int64_t>::max()) {
  bool arrived = false;
  do {
    arrived = line.run(
        0, [](const TrackingState&) {},
        [&](const TrackingState& state) {
          check_interrupt();
          return on_settled(state);
        },
        budget);
  } while (line.handed_out() < last && line.identify());
  return arrived;
}

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
  settle(line, last_tick(end, estimator.h()), [&](const TrackingState& state) {
    on_tick(state);
    return true;
  });
}

}  // namespace sprag
