/// \file
/// \brief Smallest guaranteed bound B on the error energy that a recording yields under the
/// tolerances of a scene.
#pragma once

#include <span>
#include <stop_token>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Statistics of B in the second half of a run, over the ticks where it is finite [energy].
/// Infinite if it is finite at none of them.
struct CertifiedFloor {
  double median = 0.0, largest = 0.0;  ///< of B
  double without_events = 0.0;  ///< largest B of the whole run with no event known: after a gap
};

/// \brief Runs the replica of a scene with tolerances through a recording.
/// \param scene scene with a `[tolerance]`.
/// \param events events in order of time.
/// \param duration end of the run [s], > 0.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return statistics of B.
/// \throws ModelError if the machine has no exact flow.
/// \throws Interrupted if `stop` was requested.
CertifiedFloor certified_floor(const Scene& scene, std::span<const ContactEvent> events,
                               double duration, std::stop_token stop = {});

}  // namespace sprag
