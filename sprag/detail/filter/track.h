// Track status of the event filter, and the thresholds that decide it (docs/explanation/filter.md,
// Track).
//
// tentative -> confirmed        as many fitting events as determine the state, and `trial` more
// confirmed, tentative -> lost  an innovation beyond its gate, or a missing event
// lost -> tentative             a reset of the filter's state to the replica's
#pragma once

#include <cstdint>

#include "sprag/confidence.h"

namespace sprag {

enum class TrackStatus : std::int8_t {
  lost,       ///< the filter has no estimate
  tentative,  ///< an estimate exists, its sigma is not claimed
  confirmed   ///< the sigma of the estimate is claimed
};

/// What is off by so many deviations is so for certain (once in 10^11 events by chance): an
/// innovation that refutes the belief, an event that is overdue or has not happened, two events
/// that are apart.
inline constexpr double certain = 6.7;

/// Gate of the mean normalized innovation squared over about `innovation_window` events, exceeded
/// once in 10^7 events.
inline constexpr double largest_mean_innovation = 4.0;
inline constexpr double innovation_window = 16.0;

/// Events that must fit before confirmation, besides the 2f that determine the state. Each failure
/// of a confirmed track doubles the number, up to `longest_trial`. It returns after 8 times as many
/// fitting events.
constexpr std::int64_t trial_of(ConfidenceLevel level) {
  switch (level) {
    case ConfidenceLevel::low:
      return 1;
    case ConfidenceLevel::medium:
      return 2;
    default:
      return 8;
  }
}
inline constexpr std::int64_t longest_trial = 1024;

/// Classification of a gate failure. A missing event: the gap was negative for more than this share
/// of the flight, and below minus this share of the machine's displacements. A spurious event: the
/// gap exceeds this share of the displacements, and no zero crossing is near. Also the share of the
/// flight after which an overdue impact counts as missing.
inline constexpr double clear_share = 0.05;

}  // namespace sprag
