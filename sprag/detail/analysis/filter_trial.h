// What the timing filter learns from a machine's events: it follows the machine if the events tell
// all of its motion, which the size of its covariance shows. Damping, springs and Theorem 1 are not
// needed for that.
#pragma once

#include <limits>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/scene.h"

namespace sprag {

/// A share of the uncertainty of a start that counts as known.
inline constexpr double known_share = 1e-2;

struct FilterTrial {
  double duration = 0.0;  ///< what was reached
  long closings = 0;      ///< up to there
  /// The largest standard deviation of a coordinate or a velocity over that of the start: median of
  /// the last quarter. Infinite where nothing is known.
  double left = std::numeric_limits<double>::infinity();
  /// From when on less than a hundredth is left at nearly all ticks; infinite: never.
  double known_from = std::numeric_limits<double>::infinity();

  bool ran() const { return duration > 0.0 && closings > 0; }
  /// Less than a hundredth is left.
  bool follows() const { return ran() && left < known_share; }
};

/// The filter from the replica of the scene on, with its uncertainty, drift and jitter; parameters
/// count as exact. Throws ModelError.
FilterTrial try_filter(const Scene& scene, std::span<const ContactEvent> events, double duration,
                       const TrialLimits& limits);

}  // namespace sprag
