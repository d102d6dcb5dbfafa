// Disturbed events (sprag/detail/events/disturbance.h) with the random draws of these studies.
#pragma once

#include "sprag/detail/events/disturbance.h"
#include "studies/common/random.h"

namespace sprag::common {

/// The events in order of arrival up to `end`, disturbed with draws of `seed`.
inline std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                         const Disturbance& disturbance, int contacts, double end,
                                         std::uint64_t seed) {
  return sprag::disturb(events, disturbance, contacts, end, Random(3 * seed), Random(3 * seed + 1),
                        Random(3 * seed + 2));
}

}  // namespace sprag::common
