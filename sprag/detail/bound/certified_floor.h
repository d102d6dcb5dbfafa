// Smallest guaranteed bound B on the error energy that a recording yields under the tolerances of a
// scene.
#pragma once

#include <span>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// Statistics of B in the second half of a run, over the ticks where it is finite [energy].
/// Infinite if it is finite at none of them.
struct CertifiedFloor {
  double median = 0.0, largest = 0.0;  ///< of B
  double without_events = 0.0;  ///< largest B of the whole run with no event known: after a gap
};

/// Runs the replica of a scene with tolerances through a recording: events in order of time, up to
/// `duration` > 0 [s]. Throws ModelError if the machine has no exact flow, or Interrupted.
CertifiedFloor certified_floor(const Scene& scene, std::span<const ContactEvent> events,
                               double duration);

}  // namespace sprag
