// Options of an observer, live or in a replay.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>

#include "sprag/confidence.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {

struct ObserverOptions {
  double tick = 1e-3;                                         ///< h, simulated [s]
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  EstimatorKind estimator = EstimatorKind::both;
  std::filesystem::path states;       ///< settled ticks as CSV; empty: none
  std::filesystem::path impacts;      ///< impacts at settled events as CSV; empty: none
  double predict = 0.0;               ///< horizon of predictions [s]; 0: none
  std::filesystem::path predictions;  ///< predictions as CSV; empty: none
  double history = 2.0;               ///< simulated time of ticks kept for rollbacks [s]
  bool real_time = false;             ///< SCHED_FIFO and locked memory
  bool verbose = false;               ///< a longer summary at the end

  /// The last requested tick.
  std::int64_t last() const {
    return duration < std::numeric_limits<double>::infinity()
               ? last_tick(duration, tick)
               : std::numeric_limits<std::int64_t>::max();
  }
};

}  // namespace sprag
