// tolerance: how much may be off about a scene's events and its parameters.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "tools/tolerance/bench.h"

namespace sprag::tolerance {

struct ToleranceRun {
  std::filesystem::path scene;
  std::filesystem::path csv, output;    ///< empty: none
  std::vector<std::string> estimators;  ///< empty: replica, timing and both
  Settings settings;
  int jobs = 0;  ///< threads; 0: as many as the machine has cores
  bool json = false;
  bool modes = false;  ///< in place of what may be off: with how few modes
};

/// Returns the exit code. Throws UsageError, SceneError, ModelError, std::runtime_error,
/// Interrupted.
int run_tolerance(ToleranceRun run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag::tolerance
