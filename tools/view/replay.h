// Plays a recording in place of the bus, at a selectable speed.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "tools/view/reception.h"

namespace sprag::view {

struct ReplayOptions {
  std::filesystem::path file;  ///< LCM log or events CSV; empty: none
  double speed = 1.0;          ///< factor on the recorded speed; infinite: unpaced
  double tick = 1e-3;          ///< of the observer for a recording without estimates [s]
};

/// Plays the recording to its end, or until a stop is requested. For a recording with contacts but
/// without estimates, an observer runs along, as in `observer --replay`. Returns false if the
/// recording is damaged; its readable part is played. Throws InputError, ModelError.
bool replay(const Scene& scene, const ReplayOptions& options, const CommonOptions& common,
            Stage& stage, Reception& reception, nlohmann::ordered_json& report);

}  // namespace sprag::view
