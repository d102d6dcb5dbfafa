// The program view: serves a page that shows a run live, or a recording of a run.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "command_line/program.h"
#include "tools/view/replay.h"

namespace sprag::view {

struct ViewOptions {
  std::filesystem::path scene;
  std::string http = "127.0.0.1:8080";
  ReplayOptions replay;
};

/// Serves the page until a signal arrives and returns the exit code, exit_failed for a damaged
/// recording. Throws UsageError, SceneError, InputError, ModelError, BusError, and ListenError if
/// the server cannot listen on the address.
int run_view(const ViewOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag::view
