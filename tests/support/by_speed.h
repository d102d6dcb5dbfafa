// Restitutions that depend on the speed.
#pragma once

#include "sprag/model.h"
#include "tests/support/random.h"

namespace sprag::test {

/// Lets each restitution fall by up to a half up to `speed`, by a slope or by points. No impact
/// brings two motions apart.
inline void let_restitutions_fall(Random& random, double speed, Model& model) {
  for (Contact& contact : model.contacts) {
    if (contact.restitution == 0.0) continue;
    const double falls = contact.restitution * random.uniform(0.1, 0.5);
    if (random.chance(0.5)) {
      contact.curve.slope = -falls / speed;
      continue;
    }
    const double low = contact.restitution - falls, middle = contact.restitution - 0.7 * falls;
    contact.curve.at = {0.05 * speed, 0.4 * speed, speed};
    contact.curve.value = {contact.restitution, middle, low};
  }
}

}  // namespace sprag::test
