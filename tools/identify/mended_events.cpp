#include "tools/identify/mended_events.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "sprag/detail/identification/repaired_events.h"
#include "sprag/events_file.h"

namespace sprag {
namespace {

// For each event: whether its time is far from the fit's.
std::vector<bool> suspects_of(std::size_t events, const Identification& fit) {
  constexpr double far = 4.0, no_say = 0.95;
  std::vector<bool> suspects(events, false);
  const double sigma = std::max(fit.jitter, fit.scatter);
  for (std::size_t s = 0; s < fit.measured.size(); ++s) {
    for (std::size_t k = 0; k < fit.measured[s].size(); ++k) {
      const Impact& impact = fit.measured[s].impacts[k];
      const double leverage = fit.likelihood.leverage[s][static_cast<Eigen::Index>(k)];
      if (!impact.timed || leverage > no_say || impact.event >= events) continue;
      const double off = std::abs(fit.likelihood.path[s].impacts[k].t - impact.t);
      suspects[impact.event] = off > far * sigma * std::sqrt(1.0 - leverage);
    }
  }
  return suspects;
}

}  // namespace

void write_mended(const std::filesystem::path& file, std::span<const ContactEvent> events,
                  const ContactClock& clock, const Identification& fit) {
  const std::vector<bool> suspects = suspects_of(events.size(), fit);
  NotedEventsWriter writer(file);
  for (RepairedEvent& repaired : repaired_events(events, fit)) {
    repaired.event.t = clock_time(clock, repaired.event.t);
    writer.write(repaired.event, !repaired.number             ? EventNote::lost
                                 : repaired.spurious          ? EventNote::spurious
                                 : suspects[*repaired.number] ? EventNote::suspect
                                                              : EventNote::none);
  }
  if (!writer.close()) throw std::runtime_error(writer.error());
}

}  // namespace sprag
