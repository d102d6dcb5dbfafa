// Whether events can determine the rate and the offset of the contact clock, by the structure of
// the machine and of the sought parameters.
//
// Rate: M u' + C u + K q = F in the machine's time is M u' + C/r u + K/r^2 q = F/r^2 in the time of
// a clock with the rate r. A rate is the same as a change of all stiffnesses, dampings and
// excitation frequencies together. It is determined only if one of them is held. Forces set a unit
// of time only together with a known length; otherwise lengths change by r^2.
//
// Offset: it is a shift of all phases, by Omega times the offset.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

/// Whether the events cannot determine this parameter of the clock although all parameters that are
/// not in `sought` are known. Empty: they can, or `unknown` is not of the clock.
std::optional<ClockAmbiguity> clock_ambiguity(const Scene& scene,
                                              const std::vector<Parameter>& sought,
                                              const Parameter& unknown);

/// One sentence: what the events cannot distinguish, and what must be held.
std::string to_text(const ClockAmbiguity& ambiguity);

}  // namespace sprag
