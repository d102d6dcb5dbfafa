// Options of listen.
#pragma once

#include "tools/listen/run.h"

namespace CLI {
class App;
}

namespace sprag {

/// Adds all options but the common ones and SCENE. Parsing fills `run` and `common`, which must
/// outlive `app`.
void add_listen_options(CLI::App& app, CommonOptions& common, ListenRun& run);

}  // namespace sprag
