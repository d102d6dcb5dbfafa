// The rounding of a contact force that is a small difference of large forces.
#pragma once

#include "sprag/estimation/belief.h"
#include "sprag/mechanics/dynamics.h"

namespace sprag {

/// The forces that a contact's force is made of, as terms of a measurement: 2 ulps of them count as
/// much as measurement_rounding of these. `pull` is the contact's acceleration without contact
/// forces, `size` the machine's largest coordinates and velocities.
inline double force_terms(const Dynamics& dynamics, int contact, const Functional& pull,
                          const Terms& size) {
  constexpr double ulps = 2.0 * std::numeric_limits<double>::epsilon();
  const double acceleration =
      pull.a.cwiseAbs().sum() * size.length + pull.b.cwiseAbs().sum() * size.speed;
  return ulps / measurement_rounding * acceleration / dynamics.G()(contact, contact);
}

}  // namespace sprag
