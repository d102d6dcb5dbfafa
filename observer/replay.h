// Offline replay of recorded contact events, as fast as possible and with reproducible bits.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "observer/options.h"
#include "sprag/scene.h"

namespace sprag {

struct ReplayOptions {
  std::filesystem::path file;    ///< LCM log or events CSV, recognized by content
  std::filesystem::path events;  ///< CSV for the events used; empty: none
};

/// Replays from t = 0 up to `duration`, or up to the recording's last watermark (log) or event
/// (CSV). Returns 1 if the file is damaged, else 0. Of a damaged CSV everything before the damage
/// is used, of a damaged log all readable records. Throws InputError, ModelError.
int run_replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay,
               const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag
