// tolerance: finds the largest tolerable deviations of a scene's events and parameters.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "sprag/detail/tolerance/bench.h"

namespace sprag::tolerance {

struct ToleranceRun {
  std::filesystem::path scene;
  std::filesystem::path csv, output;    ///< empty: none
  std::vector<std::string> estimators;  ///< empty: replica, timing and both
  Settings settings;
  int jobs = 0;  ///< threads; 0: as many as the machine has cores
  bool json = false;
  bool modes = false;  ///< set: study the number of modes instead of deviations
};

/// Returns the exit code. Throws UsageError, SceneError, ModelError, std::runtime_error,
/// Interrupted.
int run_tolerance(ToleranceRun run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag::tolerance
