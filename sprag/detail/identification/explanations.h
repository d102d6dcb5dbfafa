// Smallest sets of parameters whose change explains the events: none, single ones, or pairs.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

/// A set of unknowns that explains the events, and its fit.
struct Explanation {
  std::vector<std::string> keys;  ///< empty: the scene as it is
  Identification fit;
};
struct Explanations {
  /// Sets with the fewest unknowns, the best first. Empty if no two unknowns explain the events.
  std::vector<Explanation> simplest;
};

/// Finds the smallest explanations, judged by the jitter [s]. `all` is the fit of all parameters
/// that may be wrong; its repairs of the events apply here too. A subset is skipped if other
/// parameters are far from their nominal values by that fit's covariance.
Explanations explain(const Scene& scene, std::span<const ContactEvent> events,
                     const IdentificationSettings& settings, double jitter,
                     const Identification& all);

}  // namespace sprag
