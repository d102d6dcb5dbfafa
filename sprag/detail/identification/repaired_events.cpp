#include "sprag/detail/identification/repaired_events.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/identification/search.h"

namespace sprag {
namespace {

// For each event: whether its time is far from the fit's.
std::vector<bool> suspects_of(std::size_t events, const Identification& fit) {
  std::vector<bool> suspects(events, false);
  for (const EventResidual& of : fit.residuals) {
    if (of.event >= events || !(of.sigma > 0.0)) continue;
    suspects[of.event] = std::abs(of.residual) > ruled_out * of.sigma;
  }
  return suspects;
}

}  // namespace

std::vector<RepairedEvent> repaired_events(std::span<const ContactEvent> events,
                                           const Identification& fit) {
  std::vector<RepairedEvent> all;
  for (std::size_t i = 0; i < events.size(); ++i) {
    const bool spurious =
        std::find(fit.spurious.begin(), fit.spurious.end(), i) != fit.spurious.end();
    all.push_back({events[i], i, spurious});
  }
  for (const MissingImpact& impact : fit.missing) {
    all.push_back({{impact.t, impact.contact, ContactEventKind::pulse}});
  }
  std::stable_sort(all.begin(), all.end(), [](const RepairedEvent& a, const RepairedEvent& b) {
    return a.event.t < b.event.t;
  });
  return all;
}

std::vector<NotedEvent> noted_events(std::span<const ContactEvent> events,
                                     const Identification& fit) {
  const std::vector<bool> suspects = suspects_of(events.size(), fit);
  std::vector<NotedEvent> all;
  for (const RepairedEvent& repaired : repaired_events(events, fit)) {
    all.push_back({repaired.event, !repaired.number             ? EventNote::lost
                                   : repaired.spurious          ? EventNote::spurious
                                   : suspects[*repaired.number] ? EventNote::suspect
                                                                : EventNote::none});
  }
  return all;
}

}  // namespace sprag
