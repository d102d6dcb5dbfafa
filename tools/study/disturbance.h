// What can happen to event times between a machine and its observer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/mechanics/contact_event.h"

namespace sprag::study {

struct Disturbance {
  double jitter = 0.0;    ///< standard deviation of event times [s]
  double offset = 0.0;    ///< of all event times [s]
  double lost = 0.0;      ///< share of events that never arrive
  double spurious = 0.0;  ///< pulses that were none, of each contact, per unit of time, at Poisson
                          ///< times
};

/// The events as they arrive, up to `end`: each at its time plus offset and noise, but later than
/// the one before it and than t = 0, by an ulp at least, unless neither offset nor noise moves any;
/// none that contradicts the ones before it. A pure function of its arguments. With one seed and
/// run the noise is the same but for its size, and what is lost with a small share is lost with a
/// larger one too.
std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed, std::uint64_t run);

/// Drops what closes or pulses while closed, or opens while open, as observer/event_history.h does.
void drop_contradicting(std::vector<ContactEvent>& events);

}  // namespace sprag::study
