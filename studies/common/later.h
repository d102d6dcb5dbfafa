// A machine on a clock that starts later, because a master's own time begins at 0.
#pragma once

#include "sprag/model.h"

namespace sprag::common {

/// The same machine with t counted from `begin`.
inline Model later(Model model, double begin) {
  const auto shift = [&](Harmonic& harmonic) { harmonic.phase += harmonic.frequency * begin; };
  for (Force& force : model.forces) shift(force.harmonic);
  for (Contact& contact : model.contacts) shift(contact.motion);
  return model;
}

}  // namespace sprag::common
