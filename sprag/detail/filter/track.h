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
  /// Largest expected energy of the error, in that of the replica's motion, for an identification
  /// that `adaptive` accepts.
  double energy_to_accept = 0.25;
  /// Inflation of the prior standard deviations after a failure before confirmation: the root of
  /// the innovation's square, at least this.
  double least_inflation = 4.0;
  /// Share of the machine's displacements beyond which an innovation cannot be one of timing, and
  /// share of a flight beyond which a penetration cannot.
  double far = 0.05, long_inside = 0.05;
};

}  // namespace sprag
