// Test run of the timing filter on a machine's events. The filter follows the machine if the events
// make its motion observable, which its covariance shows. Damping, springs and Theorem 1 are not
// needed for that.
#pragma once

#include <limits>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/scene.h"

namespace sprag {

/// Fraction of the initial standard deviation below which a state counts as known.
inline constexpr double known_share = 1e-2;

struct FilterTrial {
  double duration = 0.0;  ///< time reached [s]
  long closings = 0;      ///< until then
  /// The largest ratio of a standard deviation of a coordinate or velocity to its initial value:
  /// median over the last quarter. Infinite if the filter did not run.
  double left = std::numeric_limits<double>::infinity();
  /// Time from which on that ratio is below known_share at nearly all ticks; infinite: never.
  double known_from = std::numeric_limits<double>::infinity();

  bool ran() const { return duration > 0.0 && closings > 0; }
  /// Whether the median ratio is below known_share, and nearly all ratios from some time on.
  bool follows() const {
    return ran() && left < known_share && known_from < std::numeric_limits<double>::infinity();
  }
};

/// Runs the filter from the replica's state of the scene, with its uncertainty, drift and jitter;
/// parameters count as exact. Throws ModelError.
FilterTrial try_filter(const Scene& scene, std::span<const ContactEvent> events, double duration,
                       const TrialLimits& limits);

}  // namespace sprag
