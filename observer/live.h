// The live observer: three threads with lock-free queues between them (mailboxes.h). One receives
// reports (reception.h), one integrates (real_time_loop.h: no allocation, no lock, no I/O), one
// publishes and writes (publication.h).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "observer/options.h"
#include "sprag/scene.h"

namespace sprag {

/// Observes until tick `duration` has settled or a signal comes. Returns the exit code. Throws
/// ModelError, BusError, InputError.
int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
