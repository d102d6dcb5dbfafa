// reduce: reads the events, reports damage of the file, chooses a correction, prints and writes.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"

namespace sprag {

struct ReduceRun {
  std::filesystem::path events, scene;
  std::filesystem::path output;  ///< empty: only the table is printed
  int modes = 0;
  bool json = false;
  double duration = std::numeric_limits<double>::infinity();  ///< later events are ignored [s]
};

/// Prints the table of candidates to standard output, writes the scene, fills `report` and returns
/// the exit code: that of a failure if the events file is damaged. Throws UsageError (modes),
/// SceneError, InputError, ModelError, and std::runtime_error (too few events, output that cannot
/// be written).
int run_reduce(const ReduceRun& run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag
