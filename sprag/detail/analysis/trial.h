// A short run of the master: what its contacts do, and whether its motion stays bounded. Neither
// can be read off the matrices.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// A trial ends at the first of them.
struct TrialLimits {
  long events = 20000;
  std::function<bool()> out_of_time = {};  ///< asked now and then; empty: there is time
};

struct ContactUse {
  long closings = 0;        ///< pulses included
  double share = 0.0;       ///< of the time in sustained contact
  double last_share = 0.0;  ///< the same in the last quarter
};

struct Trial {
  double planned = 0.0;
  double duration = 0.0;  ///< what was reached of it
  std::string error;      ///< why the simulation could not go on; empty if it could
  std::vector<ContactUse> contacts;
  long closings = 0;
  /// Of the last quarter: the longest time window in which all contacts are open (no sustained
  /// contact), and the share of all such windows.
  double longest_open = 0.0;
  double open_share = 0.0;
  std::vector<ContactEvent> events;  ///< up to the duration
  /// Largest speed or distance (in the norm of M) in the last quarter over that in the second one.
  double growth = 1.0;

  double closings_per_time() const {
    return duration > 0.0 ? static_cast<double>(closings) / duration : 0.0;
  }
};

/// From the scene's master on; where it has none the machine starts where its replica does. Throws
/// ModelError if the machine has no exact flow in free flight.
Trial run_trial(const Scene& scene, double duration, const TrialLimits& limits);

}  // namespace sprag
