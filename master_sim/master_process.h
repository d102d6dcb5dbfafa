// The master process: paces the simulated machine against the wall clock, sends its contact events
// on SPRAG_CONTACTS and, for the logger alone, its true state on SPRAG_TRUTH.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "sprag/scene.h"

namespace sprag {

struct MasterOptions {
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  double speed = 1.0;            ///< simulated s per wall s; infinite: as fast as it goes
  double tick = 1e-3;            ///< of the states, simulated [s]
  std::filesystem::path events;  ///< CSV; empty: none
  std::filesystem::path states;  ///< CSV; empty: none
  bool lcm = true;
  bool truth = true;
};

/// Runs until `duration` or a signal. Returns the exit code. Throws ModelError, BusError,
/// InputError, SimulationError (what was found until then is in the files and has been sent).
int run_master(const Scene& scene, const MasterOptions& options, const CommonOptions& common,
               nlohmann::ordered_json& report);

}  // namespace sprag
