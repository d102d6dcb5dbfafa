// The live observer. Three threads are connected by lock-free queues (mailboxes.h): one receives
// messages (reception.h), one integrates (real_time_loop.h; it does not allocate, lock or do I/O),
// one publishes and writes files (publication.h). Further threads build flows, identify parameters
// and compute impacts and predictions if needed.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "command_line/program.h"
#include "observer/options.h"
#include "sprag/scene.h"

namespace sprag {

/// Runs until tick `duration` has settled or a signal arrives. Returns the exit code. Throws
/// ModelError, BusError, InputError.
int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
