#include "sprag/detail/identification/repaired_events.h"

#include <algorithm>

namespace sprag {

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

}  // namespace sprag
