// [tolerance] of a fitted scene: hard limits from the standard deviations of a fit.
#pragma once

#include <string>
#include <vector>

#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag {

/// A limit in standard deviations.
inline constexpr double tolerated_sigmas = 4.0;

/// Limits of four standard deviations for the event times (`jitter`) and for every fitted
/// restitution, factor on stiffness or damping, and clearance. Such limits are no proof: the bound
/// holds while no error exceeds its limit.
Tolerance fitted_tolerance(const Identification& fit, double jitter);

/// Keys of fitted parameters that no tolerance covers, such as positions and frequencies.
std::vector<std::string> not_tolerated(const Identification& fit);

}  // namespace sprag
