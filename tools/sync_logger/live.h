// sync_logger on the bus: compares SPRAG_TRUTH with SPRAG_SETTLED as the messages arrive.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "command_line/program.h"
#include "sprag/model.h"

namespace sprag {

struct LiveOptions {
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  std::filesystem::path csv;                                  ///< empty: standard output
  std::filesystem::path record;  ///< LCM log of all SPRAG_* channels; empty: none
  bool now = false;              ///< also SPRAG_ESTIMATE, into now_file(csv)
};

/// File of the provisional estimates: "runs/a.csv" -> "runs/a_now.csv".
std::filesystem::path now_file(const std::filesystem::path& csv);

/// Runs until the instant `duration` has been paired or a signal arrives. Prints "listening" on
/// stderr at the start, the progress about once a second, and lost messages as soon as they are
/// known. Fills `report` and returns exit_done, or exit_failed if a recording is incomplete. Throws
/// BusError, InputError, ModelError, or another exception if a file cannot be written.
int run_live(const Model& model, const LiveOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
