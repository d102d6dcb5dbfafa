// Hard limits on the deviations of a machine and its event reports from the scene: the table
// [tolerance] of a scene. The bound B on the error energy is proven within them
// (sprag/detail/bound/bound_tracker.h).
#pragma once

#include <algorithm>

namespace sprag {

/// Largest deviations, all >= 0. A standard deviation is not such a limit. A normal distribution
/// must be truncated, for example at 4 sigma; B then holds while no deviation is larger.
struct Tolerance {
  /// Largest values that a scene may specify: of stiffness and damping, and of restitution.
  static constexpr double largest_share = 0.5, largest_restitution = 1.0;

  double time = 0.0;         ///< of a reported event time from the true one [s]
  double restitution = 0.0;  ///< of each restitution epsilon, absolute; may differ at each impact
  double stiffness = 0.0;    ///< the true K is (1 + k) K with |k| <= stiffness
  double damping = 0.0;      ///< the true C is (1 + c) C with |c| <= damping
  double force = 0.0;        ///< of the force on the machine, in the norm |f| = sqrt(f^T M^-1 f)
  double clearance = 0.0;    ///< of each clearance [m]

  /// Whether some deviation is allowed. Otherwise the bound is that of an exact machine.
  bool any() const {
    return std::max({time, restitution, stiffness, damping, force, clearance}) > 0.0;
  }
  friend bool operator==(const Tolerance&, const Tolerance&) = default;
};

}  // namespace sprag
