// Consistent contact events: a possible recording of a master with m contacts.
#pragma once

#include <vector>

#include "sprag/contact_event.h"
#include "tests/support/random.h"

namespace sprag {

/// `count` or slightly more events, in order, the first at or after `from`; up to m at one instant.
inline std::vector<ContactEvent> random_events(Random& random, int contacts, int count, double from,
                                               double mean_spacing) {
  using enum ContactEventKind;
  std::vector<ContactEvent> events;
  ContactSet chi = 0;
  double t = from;
  while (events.size() < static_cast<std::size_t>(count)) {
    const double joins = random.chance(0.3) ? 0.8 : 0.0;
    const int first = random.integer(0, contacts - 1);
    for (int i = 0; i < contacts; ++i) {
      if (i != first && !random.chance(joins)) continue;
      const auto kind = contains(chi, i) ? opens : random.chance(0.4) ? closes : pulse;
      events.push_back({t, i, kind});
      chi = after(chi, events.back());
    }
    t += random.uniform(0.05, 1.95) * mean_spacing;
  }
  return events;
}

inline ContactSet chi_after(const std::vector<ContactEvent>& events, std::size_t count) {
  ContactSet chi = 0;
  for (std::size_t i = 0; i < count; ++i) chi = after(chi, events[i]);
  return chi;
}

}  // namespace sprag
