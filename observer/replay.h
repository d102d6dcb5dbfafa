// Offline replay of recorded contact events, as fast as it goes and always with the same bits.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "observer/options.h"
#include "sprag/scene.h"

namespace sprag {

struct ReplayOptions {
  std::filesystem::path file;    ///< LCM log or events CSV, told apart by content
  std::filesystem::path events;  ///< write the events used here, as CSV; empty: do not
};

/// Replays from t = 0 up to `duration`, else up to the recording's last horizon (log) or event
/// (CSV). Returns 1 if the file is damaged (of a CSV everything before the damage is used, of a log
/// what is readable), else 0. Throws InputError, ModelError.
int run_replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay,
               const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag
