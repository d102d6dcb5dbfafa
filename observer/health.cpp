#include "observer/health.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace sprag {
namespace {

double seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

}  // namespace

EstimateSource source_of(const Confidence& confidence) {
  if (!confidence.from_filter) return EstimateSource::replica;
  return confidence.parameters.any() ? EstimateSource::adaptive : EstimateSource::filter;
}

health_t health_of(const IntegrationStatus& status, const ReceptionFigures& reception) {
  const MessageCounts& messages = status.messages;
  health_t health = status.health;
  health.latencies = status.event_latency.count();
  health.latency_p50 = seconds(status.event_latency.quantile(0.5));
  health.latency_p99 = seconds(status.event_latency.quantile(0.99));
  health.latency_max = seconds(status.event_latency.largest());
  health.lateness_p50 = seconds(status.lateness.quantile(0.5));
  health.lateness_p99 = seconds(status.lateness.quantile(0.99));
  health.lateness_max = seconds(status.lateness.largest());
  health.sessions = messages.sessions;
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
    health.cause.push_back(cause);
    health.refused.push_back(count.get<std::int64_t>());
  }
  health.causes = static_cast<std::int32_t>(health.cause.size());
  return health;
}

}  // namespace sprag
