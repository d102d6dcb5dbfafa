#include "observer/health.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

namespace sprag {
namespace {

Health::Times times_of(const Histogram& histogram) {
  const auto seconds = [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns); };
  return {seconds(histogram.quantile(0.5)), seconds(histogram.quantile(0.99)),
          seconds(histogram.largest())};
}

}  // namespace

Health::Estimate source_of(const Confidence& confidence) {
  if (!confidence.from_filter) return Health::Estimate::replica;
  return confidence.parameters.any() ? Health::Estimate::adaptive : Health::Estimate::filter;
}

Health health_of(const IntegrationStatus& status, const ReceptionFigures& reception) {
  const MessageCounts& messages = status.messages;
  Health health;
  health.session = status.session;
  health.tick = status.tick;
  health.t = status.t;
  health.master = status.master;
  health.input = status.input;
  health.period = 1e-9 * static_cast<double>(status.period);
  if (status.period > 0) health.real_time_factor = status.simulated / health.period;
  health.speed = status.speed;
  health.latencies = status.event_latency.count();
  health.latency = times_of(status.event_latency);
  health.lateness = times_of(status.lateness);
  health.sessions = messages.sessions;
  health.deadlines = status.deadlines;
  health.missed_deadlines = status.missed;
  health.real_time_losses = status.real_time_losses;
  health.events = status.events.events;
  health.late_events = status.late_events;
  health.lost_events = status.events.lost_records;
  health.gaps = status.gaps;
  health.skipped_events =
      std::accumulate(status.events.skipped.begin(), status.events.skipped.end(), std::int64_t{0});
  health.rollbacks = status.rollbacks;
  health.messages = messages.received;
  // Negative while an overtaken message is still on its way.
  health.lost_messages = std::max<std::int64_t>(messages.lost, 0);
  health.doubled_messages = messages.doubled;
  health.reordered_messages = messages.reordered;
  health.other_masters = messages.of_other_masters;
  health.stale = messages.stale;
  health.overflowed = reception.overflowed + reception.bus.overflowed;
  const nlohmann::ordered_json refused = refused_by_cause(reception, messages);
  for (const auto& [cause, count] : refused.items()) {
    health.refused.push_back({cause, count.get<std::int64_t>()});
  }
  return health;
}

}  // namespace sprag
