// The live observer: three threads with lock-free queues between them. One receives reports, one
// integrates (the real-time loop: no allocation, no lock, no I/O), one publishes and writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "sprag/estimation/estimators.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

struct ObserverOptions {
  double tick = 1e-3;                                         ///< h, simulated [s]
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  StepperKind stepper = StepperKind::exact;                   ///< of the replica
  EstimatorKind estimator = EstimatorKind::both;
  std::filesystem::path states;  ///< settled ticks as CSV; empty: none
  double history = 2.0;          ///< simulated [s] of ticks that are kept to go back to
  bool real_time = false;        ///< SCHED_FIFO and locked memory
};

/// Observes until tick `duration` has settled or a signal comes. Returns the exit code. Throws
/// ModelError, BusError, InputError.
int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
