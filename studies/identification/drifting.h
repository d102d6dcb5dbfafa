// A machine that departs from its model by the drift of [replica]: random velocity kicks between
// impacts add that energy to its error per unit of time, equally in each mode.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag::identification_study {

/// Its events up to `end`, with normal errors of standard deviation `jitter` [s]. The kicks come
/// every `push` units of time if no contact is closed.
std::vector<ContactEvent> drifting_events(const Scene& scene, double drift, double jitter,
                                          double end, double push, std::uint64_t seed);

}  // namespace sprag::identification_study
