// Options that say where the times of contacts are in a file and how they become events.
#pragma once

#include "tools/import_events/run.h"

namespace CLI {
class App;
}

namespace sprag {

/// Adds all options but the common ones, FILE, SCENE and --output. Parsing fills `run`, which must
/// outlive `app`.
void add_import_options(CLI::App& app, ImportRun& run);

}  // namespace sprag
