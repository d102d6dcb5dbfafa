// reduce: chooses a correction by recorded events, or the fewest coordinates within an accuracy.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"

namespace sprag {

struct ReduceRun {
  std::filesystem::path events;  ///< empty: none
  std::filesystem::path scene;
  std::filesystem::path output;  ///< empty: only the table is printed
  int modes = 0;                 ///< 0: chosen by `accuracy`
  double accuracy = 0.0;         ///< [m]
  bool json = false;
  double duration = std::numeric_limits<double>::infinity();  ///< later events are ignored [s]
};

/// Prints the table of candidates, or what the accuracy needs, to standard output, writes the
/// scene, fills `report` and returns the exit code: that of a failure if the events file is
/// damaged. Throws UsageError, SceneError, InputError, ModelError, and std::runtime_error (too few
/// events, output that cannot be written).
int run_reduce(const ReduceRun& run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag
