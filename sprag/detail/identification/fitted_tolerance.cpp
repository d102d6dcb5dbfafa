#include "sprag/detail/identification/fitted_tolerance.h"

#include <algorithm>
#include <cmath>

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
    switch (fitted.unknown.kind) {
      case Unknown::Kind::restitution:
        // A common factor changes each restitution, which is at most 1, by at most this.
        raise(tolerance.restitution, limit, Tolerance::largest_restitution);
        break;
      case Unknown::Kind::stiffness:
        raise(tolerance.stiffness, share, Tolerance::largest_share);
        break;
      case Unknown::Kind::damping:
        raise(tolerance.damping, share, Tolerance::largest_share);
        break;
      case Unknown::Kind::clearance:
        tolerance.clearance = std::max(tolerance.clearance, limit);
        break;
      default:
        break;
    }
  }
  return tolerance;
}

std::vector<std::string> not_tolerated(const Identification& fit) {
  std::vector<std::string> keys;
  for (const FittedUnknown& fitted : fit.unknowns) {
    switch (fitted.unknown.kind) {
      case Unknown::Kind::restitution:
      case Unknown::Kind::stiffness:
      case Unknown::Kind::damping:
      case Unknown::Kind::clearance:
        break;
      default:
        if (fitted.determined) keys.push_back(fitted.unknown.key);
    }
  }
  return keys;
}

}  // namespace sprag
