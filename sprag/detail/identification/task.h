// One identification of an adaptive estimator, from the events that it has received to the belief
// that its filter starts from. It takes some tenths of a second and allocates. It should run in
// another thread than the estimator.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {

/// Input of an identification. Equal tasks give equal results, bit for bit.
struct AdaptationTask {
  std::vector<ContactEvent> events;
  double begins = 0.0;      ///< all events after this time are in `events` [s]
  ContactSet closed = 0;    ///< contacts closed at that time
  std::int64_t number = 0;  ///< number of its last event, counted from the estimator's start
};

struct AdaptationResult {
  AdaptationTask task;
  bool accepted = false;
  /// The last event of the task is the last impact of the path, so `belief` holds for state and
  /// unknowns after it. If false, `belief` holds for the unknowns alone.
  bool state_is_known = false;
  FilterBelief belief;
};

/// The unknowns of [adapt] in a scene. If it names none: all but the one that fixes the scale.
/// Throws std::invalid_argument for an unknown key.
std::vector<Parameter> unknowns_to_adapt(const Scene& scene);

/// Standard deviations of the random walks of [adapt], in coordinates and a unit of time.
Eigen::VectorXd walk_of(const Scene& scene, Eigen::Index unknowns);

/// Runs an identification. Throws Interrupted (interrupt.h).
AdaptationResult run(const AdaptationTask& task, const SceneValues& family);

}  // namespace sprag
