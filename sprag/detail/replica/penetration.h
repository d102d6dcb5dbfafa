// Whether an estimate shows a state that the machine cannot have: one with a gap below zero. A
// replica that has not converged yet does so, since its clutches do not know where the supports
// are.
#pragma once

#include <Eigen/Core>
#include <span>

#include "sprag/model.h"

namespace sprag {

/// The largest depth of q inside a support at time t [m]; 0: it is inside none. A depth counts from
/// 1e-9 `length` on, the machine's length_scale() (mechanics/scale.h), so that rounding does not
/// count, and from 4 of the gap's standard deviations on where `sigma_gap` has a finite one. q may
/// leave out the last coordinates of the contacts' directions. Does not allocate.
double penetration(std::span<const Contact> contacts, const Eigen::Ref<const Eigen::VectorXd>& q,
                   double t, const Eigen::VectorXd& sigma_gap, double length);

}  // namespace sprag
