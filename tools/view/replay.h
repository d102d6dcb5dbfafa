// A recording in place of the bus, at a pace of one's own.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "tools/view/reception.h"

namespace sprag::view {

struct ReplayOptions {
  std::filesystem::path file;  ///< LCM log or events CSV; empty: none
  double speed = 1.0;          ///< times as fast as it was recorded; infinite: does not wait
  double tick = 1e-3;          ///< of the observer that runs where the recording has none [s]
};

/// Plays the recording to its end, or until a stop is requested. One that has contacts but no
/// estimates is observed meanwhile, as `observer --replay` does. Returns false if it is damaged;
/// what is readable is played. Throws InputError, ModelError.
bool replay(const Scene& scene, const ReplayOptions& options, const CommonOptions& common,
            Stage& stage, Reception& reception, nlohmann::ordered_json& report);

}  // namespace sprag::view
