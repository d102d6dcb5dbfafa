// The master process: paces the simulated machine by the wall clock, publishes its contact events
// on SPRAG_CONTACTS and, for the logger only, its true state on SPRAG_TRUTH.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "sprag/scene.h"

namespace sprag {

struct MasterOptions {
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  double speed = 1.0;            ///< simulated s per wall s; infinite: as fast as possible
  double tick = 1e-3;            ///< interval of the states, simulated [s]
  std::filesystem::path events;  ///< CSV; empty: none
  std::filesystem::path states;  ///< CSV; empty: none
  bool lcm = true;
  bool truth = true;
  bool publish_input = false;  ///< publish the record of the excitation on SPRAG_INPUT
};

/// Runs until `duration` or a signal. Returns the exit code. Throws ModelError, BusError,
/// InputError, SimulationError; the results until then have been written and sent.
int run_master(const Scene& scene, const MasterOptions& options, const CommonOptions& common,
               nlohmann::ordered_json& report);

}  // namespace sprag
