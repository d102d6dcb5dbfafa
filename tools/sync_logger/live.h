// sync_logger on the bus: SPRAG_TRUTH against SPRAG_SETTLED, as they arrive.
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

/// "runs/a.csv" -> "runs/a_now.csv".
std::filesystem::path now_file(const std::filesystem::path& csv);

/// Listens until the instant `duration` has been paired or a signal comes; says "listening" on
/// stderr once it does, then its progress about once a second. Messages that are lost on the way
/// here are reported on stderr as soon as that is known. Fills `report` and returns exit_done, or
/// exit_failed where a recording is not complete. Throws BusError, InputError, ModelError, or
/// another exception if a file cannot be written.
int run_live(const Model& model, const LiveOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
