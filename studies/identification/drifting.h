// A machine that departs from its model as [replica] drift says: between impacts it is pushed at
// random, which adds that energy to its error in a unit of time, the same to each of its modes.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag::identification_study {

/// Its events up to `end`, with normal errors of standard deviation `jitter` [s]. It is pushed
/// every `push` of a unit of time at which no contact is closed.
std::vector<ContactEvent> drifting_events(const Scene& scene, double drift, double jitter,
                                          double end, double push, std::uint64_t seed);

}  // namespace sprag::identification_study
