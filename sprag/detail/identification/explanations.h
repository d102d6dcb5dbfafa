// Which parameters alone explain the events: none, single ones, or pairs.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

/// Which of the unknowns together explain the events, as few as do: none where the scene as it is
/// fits, single ones, else pairs.
struct Explanation {
  std::vector<std::string> keys;  ///< empty: the scene as it is
  Identification fit;
};
struct Explanations {
  /// Those with the fewest unknowns, the best first; empty: no two explain them.
  std::vector<Explanation> simplest;
};

/// Judges them by the jitter `jitter` [s]. `all` is the fit of all that may be wrong: its repairs
/// of the events hold here too. A subset whose other parameters are far from their nominal values,
/// by that fit's covariance, is not tried.
Explanations explain(const Scene& scene, std::span<const ContactEvent> events,
                     const IdentificationSettings& settings, double jitter,
                     const Identification& all);

}  // namespace sprag
