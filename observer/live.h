// The live observer: three threads with lock-free queues between them. One receives reports, one
// integrates (the real-time loop: no allocation, no lock, no I/O), one publishes and writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <type_traits>

#include "lcmtypes/program.h"
#include "mechanics/moreau.h"
#include "mechanics/replica.h"
#include "mechanics/scene.h"
#include "observer/timing_filter.h"

namespace sprag {

enum class StepperKind { exact, moreau };
enum class EstimatorKind { replica, timing };

struct ObserverOptions {
  double tick = 1e-3;                                         ///< h, simulated [s]
  double duration = std::numeric_limits<double>::infinity();  ///< simulated [s]
  StepperKind stepper = StepperKind::exact;                   ///< of the replica
  EstimatorKind estimator = EstimatorKind::replica;
  std::filesystem::path states;  ///< settled ticks as CSV; empty: none
  double history = 2.0;          ///< simulated [s] of ticks that are kept to go back to
  bool real_time = false;        ///< SCHED_FIFO and locked memory
};

/// What moves the estimate, of one of the types Replica, MoreauReplica, TimingFilter.
template <typename Stepper>
Stepper make_stepper(const Scene& scene, double h) {
  if constexpr (std::is_same_v<Stepper, TimingFilter>) {
    return TimingFilter(scene.model, h, uncertainty_of(scene));
  } else {
    return Stepper(scene.model, h);
  }
}

/// Calls run.operator()<Stepper>() with the type that the options ask for.
template <typename Run>
int with_stepper(const ObserverOptions& options, const Run& run) {
  if (options.estimator == EstimatorKind::timing) return run.template operator()<TimingFilter>();
  if (options.stepper == StepperKind::moreau) return run.template operator()<MoreauReplica>();
  return run.template operator()<Replica>();
}

/// Observes until tick `duration` has settled or a signal comes. Returns the exit code. Throws
/// ModelError, BusError, InputError.
int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
