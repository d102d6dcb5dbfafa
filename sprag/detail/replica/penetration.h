// Detects an estimate inside a support, where the machine cannot be. A replica that has not
// converged can be inside, because its clutches do not depend on the supports' positions.
#pragma once

#include <Eigen/Core>
#include <span>

#include "sprag/model.h"

namespace sprag {

/// Largest depth of q inside a support at time t [m]; 0: outside of all. A depth counts if it
/// exceeds rounding, 1e-9 `length`, the machine's length_scale() (mechanics/scale.h), and 4
/// standard deviations of the gap, if `sigma_gap` has a finite one. q may have fewer entries than
/// the contacts' directions; the last ones are missing. Does not allocate.
double penetration(std::span<const Contact> contacts, const Eigen::Ref<const Eigen::VectorXd>& q,
                   double t, const Eigen::VectorXd& sigma_gap, double length);

}  // namespace sprag
