// An Observer (estimation/observer.h) whose model may be wrong: what scene.adaptation says of the
// machine is identified from its events (adaptive_estimator.h). It identifies where it settles, so
// that settle() takes some tenths of a second there; settled estimates are those of
// `observer --estimator adaptive`, bit for bit.
//
//   sprag::Observer observer = sprag::adaptive_observer(sprag::read_scene("rig.toml"), 0.01);
#pragma once

#include "sprag/estimation/observer.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

/// At tick 0, in scene.replica; `tick` > 0 [s]. Throws ModelError where there is no adaptive
/// estimator of this scene, and std::invalid_argument for a tick or a key in scene.adaptation that
/// is none. Its at() throws std::invalid_argument where more than 1023 events, or fewer of very
/// large machines (AdaptiveEstimator::most_ahead()), lie between what is settled and t.
Observer adaptive_observer(const Scene& scene, double tick);

/// Any observer of a scene: adaptive_observer() where `settings` ask for one, one that estimates
/// state and parameters where a filter is asked for and the scene has [parameters], else
/// Observer(scene, settings). Throws as they do.
Observer make_observer(const Scene& scene, const ObserverSettings& settings = {});

}  // namespace sprag
