#include "sprag/detail/identification/fitted_tolerance.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
Tolerance fitted_tolerance(const Identification& fit, double jitter) {
  Tolerance tolerance;
  tolerance.time = tolerated_sigmas * jitter;
  for (const FittedUnknown& fitted : fit.unknowns) {
    if (!fitted.determined || !std::isfinite(fitted.sigma)) continue;
    const double limit = tolerated_sigmas * fitted.sigma;
    const double share = fitted.value != 0.0 ? std::abs(limit / fitted.value) : 0.0;
    const auto raise = [](double& of, double to, double most) {
      of = std::min(std::max(of, to), most);
    };
    const std::string_view covered = tolerance_of(fitted.unknown);
    if (covered == "restitution") {
      // A common factor changes each restitution, which is at most 1, by at most this.
      raise(tolerance.restitution, limit, Tolerance::largest_restitution);
    } else if (covered == "stiffness") {
      raise(tolerance.stiffness, share, Tolerance::largest_share);
    } else if (covered == "damping") {
      raise(tolerance.damping, share, Tolerance::largest_share);
    } else if (covered == "clearance") {
      tolerance.clearance = std::max(tolerance.clearance, limit);
    }
  }
  return tolerance;
}

std::vector<std::string> not_tolerated(const Identification& fit) {
  std::vector<std::string> keys;
  for (const FittedUnknown& fitted : fit.unknowns) {
    const bool covered = !tolerance_of(fitted.unknown).empty();
    if (fitted.determined && !covered) keys.push_back(fitted.unknown.key);
  }
  return keys;
}

}  // namespace sprag
