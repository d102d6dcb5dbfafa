// How low the guaranteed bound comes on a given recording: what a scene's tolerances allow to be
// promised.
#pragma once

#include <span>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// Of the bound B in the second half of a run, where it is finite [energy]; infinite where it is
/// never.
struct CertifiedFloor {
  double median = 0.0, largest = 0.0;
  double without_events = 0.0;  ///< the largest B, anywhere, if no event were known: after a gap
};

/// \brief Runs the replica of a scene with tolerances through events up to `duration` [s].
/// Throws ModelError or Interrupted.
CertifiedFloor certified_floor(const Scene& scene, std::span<const ContactEvent> events,
                               double duration);

}  // namespace sprag
