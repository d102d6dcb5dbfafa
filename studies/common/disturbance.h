// What can happen to event times between a machine and its observer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/mechanics/contact_event.h"

namespace sprag::common {

struct Disturbance {
  double jitter = 0.0;    ///< standard deviation of event times [s]
  double offset = 0.0;    ///< of all event times [s]
  double missed = 0.0;    ///< share of events that never arrive
  double spurious = 0.0;  ///< pulses that were none, per unit of time, at Poisson times
};

/// The events as they arrive, up to `end`: each at its time plus offset and noise, but later than
/// the one before it and than t = 0, by an ulp at least, since events of one instant would be one
/// impact; none that contradicts the ones before it. With one seed the noise is the same but for
/// its size, and what is missed with a small share is missed with a larger one too.
std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed);

/// As observer/event_history.h: drops what closes or pulses while closed, or opens while open.
void drop_contradicting(std::vector<ContactEvent>& events);

}  // namespace sprag::common
