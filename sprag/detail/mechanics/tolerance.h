// How far a machine and its event reports may depart from the scene: hard limits, [tolerance] of a
// scene, for which the bound B on the error energy is proven (sprag/detail/bound/bound_tracker.h).
#pragma once

#include <algorithm>

namespace sprag {

/// Largest deviations, all >= 0. A standard deviation is no such limit: a normal distribution has
/// to be cut, for example at 4 sigma, and B then holds as long as no deviation is larger.
struct Tolerance {
  /// Largest values that a scene may give: of stiffness and damping, and of restitution.
  static constexpr double largest_share = 0.5, largest_restitution = 1.0;

  double time = 0.0;         ///< of a reported event time from the true one [s]
  double restitution = 0.0;  ///< of each restitution epsilon, absolute; may differ at each impact
  double stiffness = 0.0;    ///< the true K is (1 + k) K with |k| <= stiffness
  double damping = 0.0;      ///< the true C is (1 + c) C with |c| <= damping
  double force = 0.0;        ///< of the force on the machine, in the norm |f| = sqrt(f^T M^-1 f)
  double clearance = 0.0;    ///< of each clearance [m]

  /// Whether some deviation is allowed. Without any, the bound is that of an exact machine.
  bool any() const {
    return std::max({time, restitution, stiffness, damping, force, clearance}) > 0.0;
  }
  friend bool operator==(const Tolerance&, const Tolerance&) = default;
};

}  // namespace sprag
