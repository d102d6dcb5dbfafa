// diagnose: reads the events, reports damage of the file, diagnoses and prints.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "command_line/program.h"

namespace sprag {

inline constexpr int exit_does_not_fit = 3;  ///< the events do not fit, no failure

struct DiagnoseRun {
  std::filesystem::path log, scene;
  bool json = false;
  std::optional<double> jitter;                               ///< [s]; empty: the scene's
  double duration = std::numeric_limits<double>::infinity();  ///< later events are ignored [s]
};

/// Prints the diagnosis to standard output, fills `report` and returns the exit code: that of a
/// failure if the file is damaged. Throws SceneError, InputError, ModelError, and
/// std::runtime_error (too few events, output that cannot be written).
int run_diagnose(const DiagnoseRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report);

}  // namespace sprag
