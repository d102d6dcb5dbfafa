// Options of listen.
#pragma once

#include "sprag/contact_event.h"
#include "tools/listen/run.h"

namespace CLI {
class App;
}

namespace sprag {

/// Adds all options but the common ones and SCENE. Parsing fills `run` and `common`, which must
/// outlive `app`.
void add_listen_options(CLI::App& app, CommonOptions& common, ListenRun& run);

/// Throws UsageError if --rate and the scene's [clock] would both correct the rate of the clock.
/// Says on stderr that two offsets add up.
void check_clock(const ContactClock& clock, const DeviceClockOptions& options);

}  // namespace sprag
