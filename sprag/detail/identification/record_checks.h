// What a record of contact events shows by itself, before any machine is fitted to it.
#pragma once

#include <span>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// Events at which a contact closes. Those that follow the one before them within `nearest` [s] are
/// not distinguished from it.
int distinct_closings(std::span<const ContactEvent> events, double nearest);

/// Whether the closings repeat after at most four of them, to twice the jitter [s], 0 if it is not
/// known: such a record determines so many times and a period, and nothing else.
bool is_periodic(std::span<const ContactEvent> events, double jitter);

/// Whether many impacts of the scene's machine, single ones or the last of a chatter, follow others
/// sooner than any recorded event does: the sensor merges such bounces. False where the scene has
/// no possible start.
bool has_merged_bounces(const Scene& scene, std::span<const ContactEvent> events);

}  // namespace sprag
