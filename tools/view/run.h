// view: a page that shows a run while it goes on, or a recording of one.
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

/// Serves the page until a signal comes, and returns the exit code: that of a failure if a
/// recording is damaged. Throws UsageError, SceneError, InputError, ModelError, BusError, and
/// std::runtime_error where the address cannot be listened on.
int run_view(const ViewOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag::view
