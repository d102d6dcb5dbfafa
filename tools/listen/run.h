// listen: reads edges from a source, publishes contact events.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "command_line/program.h"
#include "sprag/scene.h"
#include "tools/listen/intake.h"

namespace sprag {

struct ListenRun {
  std::string serial;  ///< device; empty: none
  int baud = 115200;
  std::optional<int> tcp;        ///< port on 127.0.0.1
  std::filesystem::path record;  ///< LCM log; empty: none
  IntakeOptions intake;          ///< run_listen() completes it by the scene
};

/// Reads until the end of the source, the duration or a signal, fills `report` and returns the exit
/// code. Throws UsageError for bad options, or a source that cannot be opened; BusError; and
/// std::runtime_error if the source ends without a usable line, or the recording is not complete.
int run_listen(ListenRun run, const Scene& scene, const CommonOptions& common,
               nlohmann::ordered_json& report);

}  // namespace sprag
