// Checks of a record of contact events without a fit.
#pragma once

#include <span>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// Whether the closings repeat after at most four of them, within twice the jitter [s], 0 if
/// unknown. Such a record determines the few times of one period and nothing else.
bool is_periodic(std::span<const ContactEvent> events, double jitter);

/// Whether many impacts of the scene's machine, single ones or the last of a chatter, follow the
/// previous one sooner than any recorded event does. The sensor then merges such bounces. False if
/// the scene has no possible start.
bool has_merged_bounces(const Scene& scene, std::span<const ContactEvent> events);

}  // namespace sprag
