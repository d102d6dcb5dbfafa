// The live observer: three threads with lock-free queues between them. One receives reports, one
// integrates (the real-time loop: no allocation, no lock, no I/O), one publishes and writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "mechanics/scene.h"

namespace sprag {

enum class StepperKind { exact, moreau };

struct ObserverOptions {
  double tick = 1e-3;                                         ///< h, simulated [s]
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  StepperKind stepper = StepperKind::exact;
  std::filesystem::path states;  ///< settled ticks as CSV; empty: none
};

/// Observes until tick `duration` has settled or a signal comes. Returns the exit code. Throws
/// ModelError, BusError.
int run_live(const Scene& scene, const ObserverOptions& options, const std::string& url,
             nlohmann::ordered_json& report);

}  // namespace sprag
