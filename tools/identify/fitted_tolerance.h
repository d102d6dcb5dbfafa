// [tolerance] of a fitted scene: hard limits from the deviations of a fit.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/mechanics/tolerance.h"
#include "sprag/identification.h"

namespace sprag {

/// How many standard deviations a limit has.
inline constexpr double tolerated_sigmas = 4.0;

/// Four standard deviations of the event times (`jitter`) and of every fitted restitution, factor
/// on stiffness or damping, and clearance. A limit of normal deviations is no proof: the bound
/// holds as long as nothing is off by more.
Tolerance fitted_tolerance(const Identification& fit, double jitter);

/// Keys of fitted parameters that no tolerance covers, such as positions and frequencies.
std::vector<std::string> not_tolerated(const Identification& fit);

}  // namespace sprag
