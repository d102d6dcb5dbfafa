// Offline fixed-interval smoothing of a recording (sprag/smoother.h).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "observer/options.h"
#include "observer/replay.h"
#include "sprag/scene.h"

namespace sprag {

/// Writes the smoothed ticks from t = 0 up to `duration`, or up to the last event. Returns the exit
/// code. Throws InputError, ModelError, and UsageError if smoothing is not possible: event times
/// without a jitter, or a recording that lacks events since t = 0.
int run_smoothing(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay,
                  const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag
