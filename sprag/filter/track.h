// Track status of the event filter beside a replica, and the thresholds that decide it.
//
// tentative -> confirmed  after as many events that fit as determine the state, and some more
// confirmed, tentative -> lost  by an innovation beyond its gate, or a missing event
// lost -> tentative  by a reset of the filter's state to the replica's
#pragma once

#include <cstdint>

namespace sprag {

enum class TrackStatus : std::int8_t {
  lost,       ///< the filter has no estimate
  tentative,  ///< it has one whose sigma is not claimed yet
  confirmed   ///< its sigma is claimed
};

/// Gate of one normalized innovation squared: chi^2 of one degree of freedom exceeds it once in
/// 10^11 events.
inline constexpr double largest_innovation = 45.0;

/// docs/measurements/robustness.md has a table of what each of them buys.
struct TrackThresholds {
  double innovation = largest_innovation;
  /// Gate of their mean over about `window` events, exceeded once in 10^7.
  double mean_innovation = 4.0;
  double window = 16.0;
  /// Events that must fit before confirmation, beside the 2f that determine the state. Doubled, up
  /// to `longest_trial`, by each failure of a confirmed track; reset after 8 times as many events.
  std::int64_t trial = 8, longest_trial = 1024;
  /// Largest expected energy of the error, in that of the replica's motion, for confirmation.
  double energy_to_confirm = 0.25;
  /// Largest expected energy of the error, in that of the largest motion so far, of any estimate.
  double energy_to_keep = 1.2;
  /// Inflation of the prior standard deviations after a failure before confirmation: the root of
  /// the innovation's square, within these limits.
  double least_inflation = 4.0, most_inflation = 1e4;
  /// Share of the machine's displacements beyond which an innovation cannot be one of timing, and
  /// share of a flight beyond which a penetration cannot.
  double far = 0.05, long_inside = 0.05;
};

}  // namespace sprag
