// A short run of the master. It shows how its contacts are used and whether its motion stays
// bounded, which do not follow from the matrices.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// A trial ends at the first limit.
struct TrialLimits {
  long events = 20000;
  std::function<bool()> out_of_time = {};  ///< called from time to time; empty: no time limit
};

struct ContactUse {
  long closings = 0;        ///< pulses included
  double share = 0.0;       ///< fraction of the time in sustained contact
  double last_share = 0.0;  ///< the same in the last quarter
};

struct Trial {
  double planned = 0.0;
  double duration = 0.0;  ///< time reached
  std::string error;      ///< why the simulation could not continue; empty if it could
  std::vector<ContactUse> contacts;
  long closings = 0;
  /// In the last quarter: the longest interval in which all contacts are open (no sustained
  /// contact), and the fraction of all such intervals.
  double longest_open = 0.0;
  double open_share = 0.0;
  std::vector<ContactEvent> events;  ///< up to the duration
  /// Ratio of the largest speed or distance (in the norm of M) in the last quarter to that in the
  /// second quarter.
  double growth = 1.0;

  double closings_per_time() const {
    return duration > 0.0 ? static_cast<double>(closings) / duration : 0.0;
  }
};

/// Runs from the scene's master state, or without a master from the replica's state. Throws
/// ModelError if the machine has no exact flow in free flight.
Trial run_trial(const Scene& scene, double duration, const TrialLimits& limits);

}  // namespace sprag
