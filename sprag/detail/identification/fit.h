// Identification of a machine from the times of its events: one least-squares problem
// (gauss_newton.h), one search (search.h) and one table of checks (judgement.h).
#pragma once

#include <span>

#include "sprag/detail/identification/gauss_newton.h"
#include "sprag/identification.h"

namespace sprag {

struct EventIdentification {
  Identification result;
  EventFit fit;  ///< stretches in order of time; empty without a fit
};

/// As identify(), for parameters that are not ambiguous with the clock.
EventIdentification fit_events(const Scene& scene, std::span<const ContactEvent> events,
                               const IdentificationSettings& settings);

}  // namespace sprag
