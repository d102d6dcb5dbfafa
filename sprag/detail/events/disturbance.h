// Disturbances of event times between a machine and its observer.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag {

struct Disturbance {
  double jitter = 0.0;    ///< standard deviation of event times [s]
  double offset = 0.0;    ///< added to all event times [s]
  double lost = 0.0;      ///< fraction of events that never arrive
  double spurious = 0.0;  ///< rate of spurious pulses of each contact per unit of time, at Poisson
                          ///< times
};

/// Drops events that close or pulse a closed contact, or open an open one, as event_history.h does.
inline void drop_contradicting(std::vector<ContactEvent>& events) {
  ContactSet chi = 0;
  std::erase_if(events, [&](const ContactEvent& event) {
    const bool opens = event.kind == ContactEventKind::opens;
    if (contains(chi, event.contact) != opens) return true;
    chi = after(chi, event);
    return false;
  });
}

/// The events as they arrive, up to `end`. Each is shifted by offset and noise, but stays later
/// than the previous one and than t = 0 by at least an ulp, unless both offset and noise are zero.
/// Events that contradict earlier ones are dropped. Times, losses and pulses have one source of
/// random numbers each, so that one does not change the draws of another. A source has uniform(),
/// exponential() and normal().
template <class Source>
std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  Source of_times, Source of_losses, Source of_pulses) {
  const auto earlier = [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; };
  // Events of one instant are one impact and stay simultaneous without offset and noise.
  const bool moved = disturbance.jitter != 0.0 || disturbance.offset != 0.0;
  std::vector<ContactEvent> arrived;
  double last = 0.0;
  for (ContactEvent event : events) {
    const double noise = disturbance.jitter * of_times.normal();
    if (of_losses.uniform() < disturbance.lost) continue;
    if (moved) {
      event.t = std::max(std::nextafter(last, std::numeric_limits<double>::infinity()),
                         event.t + disturbance.offset + noise);
    }
    last = event.t;
    arrived.push_back(event);
  }
  const double rate = disturbance.spurious;
  for (int contact = 0; rate > 0.0 && contact < contacts; ++contact) {
    for (double t = of_pulses.exponential() / rate; t < end; t += of_pulses.exponential() / rate) {
      arrived.push_back({t, contact, ContactEventKind::pulse});
    }
  }
  std::stable_sort(arrived.begin(), arrived.end(), earlier);
  drop_contradicting(arrived);
  std::erase_if(arrived, [&](const ContactEvent& event) { return event.t > end; });
  return arrived;
}

}  // namespace sprag
