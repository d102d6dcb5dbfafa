// Track status of the event filter, and the thresholds that decide it (docs/explanation/filter.md,
// Track).
//
// tentative -> confirmed        as many fitting events as determine the state, and `trial` more
// confirmed, tentative -> lost  an innovation beyond its gate, or a missing event
// lost -> tentative             a reset of the filter's state to the replica's
#pragma once

#include <cstdint>

namespace sprag {

enum class TrackStatus : std::int8_t {
  lost,       ///< the filter has no estimate
  tentative,  ///< an estimate exists, its sigma is not claimed
  confirmed   ///< the sigma of the estimate is claimed
};

/// Gate of a single normalized innovation squared. chi^2 of one degree of freedom exceeds it once
/// in 10^11 events.
inline constexpr double largest_innovation = 45.0;

/// The effect of each threshold is measured in docs/measurements/robustness.md.
struct TrackThresholds {
  double innovation = largest_innovation;
  /// Gate of the mean normalized innovation squared over about `window` events, exceeded once in
  /// 10^7 events.
  double mean_innovation = 4.0;
  double window = 16.0;
  /// Events that must fit before confirmation, besides the 2f that determine the state. Each
  /// failure of a confirmed track doubles the number, up to `longest_trial`. It returns to `trial`
  /// after 8 times as many fitting events.
  std::int64_t trial = 8, longest_trial = 1024;
  /// `adaptive` accepts an identification if the expected energy of its error is below this share
  /// of the energy of the replica's motion.
  double energy_to_accept = 0.25;
  /// Least factor of covariance inflation after a failure before confirmation. The factor is the
  /// root of the normalized innovation squared, at least this.
  double least_inflation = 4.0;
  /// Classification of a gate failure. A missing event: the gap was negative for more than
  /// `long_inside` of the flight and below -`far` times the machine's displacements. A spurious
  /// event: the gap exceeds `far` times the displacements, and no zero crossing is near.
  /// `long_inside` is also the share of the flight after which an overdue impact counts as missing.
  double far = 0.05, long_inside = 0.05;
};

}  // namespace sprag
