// Checks of a record of contact events without a fit.
#pragma once

#include <cstddef>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// The number of closings, at most four, after which they repeat within twice the jitter [s], 0 if
/// unknown; 0: they do not repeat. Such a record determines the times of one period and nothing
/// else, hence no more numbers than these.
std::size_t closings_per_period(std::span<const ContactEvent> events, double jitter);

/// Whether many impacts of the scene's machine, single ones or the last of a chatter, follow the
/// previous one sooner than any recorded event does. The sensor then merges such bounces. False if
/// the scene has no possible start.
bool has_merged_bounces(const Scene& scene, std::span<const ContactEvent> events);

}  // namespace sprag
