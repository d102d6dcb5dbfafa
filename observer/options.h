// What an observer runs, live or in a replay.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/replica/any_replica.h"

namespace sprag {

struct ObserverOptions {
  double tick = 1e-3;                                         ///< h, simulated [s]
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  StepperKind stepper = StepperKind::exact;                   ///< of the replica
  EstimatorKind estimator = EstimatorKind::both;
  std::filesystem::path states;       ///< settled ticks as CSV; empty: none
  std::filesystem::path impacts;      ///< what is said of each event as CSV; empty: none
  double predict = 0.0;               ///< events are foreseen so far ahead [s]; 0: not at all
  std::filesystem::path predictions;  ///< these as CSV; empty: none
  double history = 2.0;               ///< simulated [s] of ticks that are kept to go back to
  bool real_time = false;             ///< SCHED_FIFO and locked memory

  /// The last tick that is wanted.
  std::int64_t last() const {
    return duration < std::numeric_limits<double>::infinity()
               ? last_tick(duration, tick)
               : std::numeric_limits<std::int64_t>::max();
  }
};

}  // namespace sprag
