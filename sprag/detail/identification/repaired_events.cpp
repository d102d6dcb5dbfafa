#include "sprag/detail/identification/repaired_events.h"

#include <algorithm>
#include <cmath>

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
