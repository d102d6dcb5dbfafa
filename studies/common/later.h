// A machine on a clock that starts later: a master's own time begins at 0.
#pragma once

#include "sprag/model.h"

namespace sprag::common {

/// The same machine where t is counted from `begin` on.
inline Model later(Model model, double begin) {
  const auto shift = [&](Harmonic& harmonic) { harmonic.phase += harmonic.frequency * begin; };
  for (Force& force : model.forces) shift(force.harmonic);
  for (Contact& contact : model.contacts) shift(contact.motion);
  return model;
}

}  // namespace sprag::common
