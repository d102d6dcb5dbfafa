// One identification of an adaptive estimator, from what it has heard to what its filter
// starts from. Takes some tenths of a second, and allocates: it is for another thread than the
// estimator's.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/identification/machine_family.h"

namespace sprag {

/// What is to be identified. The same events give the same result, bit for bit.
struct AdaptationTask {
  std::vector<ContactEvent> events;
  double begins = 0.0;      ///< all events since then are there [s]
  ContactSet closed = 0;    ///< there
  std::int64_t number = 0;  ///< of its last event, counted from the estimator's start
};

struct AdaptationResult {
  AdaptationTask task;
  bool accepted = false;
  /// The last event of the task was the last impact of the path: the belief is what is known of
  /// state and unknowns behind it. Else it is of use for the unknowns alone.
  bool state_is_known = false;
  FilterBelief belief;
};

/// What a scene says may be wrong (Scene::adaptation), as identification takes it: all but what
/// holds the scale where it names nothing. Throws std::invalid_argument for a key that is none.
std::vector<Unknown> unknowns_to_adapt(const Scene& scene);

/// How far the unknowns of a scene's [adapt] walk, in coordinates and a unit of time.
Eigen::VectorXd walk_of(const Scene& scene, Eigen::Index unknowns);

/// Throws Interrupted (interrupt.h).
AdaptationResult run(const AdaptationTask& task, const MachineFamily& family);

}  // namespace sprag
