// Command line of the observer.
#pragma once

#include <filesystem>

#include "command_line/program.h"
#include "observer/options.h"
#include "observer/replay.h"

namespace CLI {
class App;
}

namespace sprag {

struct ObserverCommand {
  std::filesystem::path scene;
  ObserverOptions options;
  ReplayOptions replay;
  std::optional<ConfidenceLevel> confidence;  ///< in place of the scene's
  bool smooth = false;
};

/// Adds all options but the common ones. Parsing fills `command`, which must outlive `app`.
void add_observer_options(CLI::App& app, CommonOptions& common, ObserverCommand& command);

/// Checks options that depend on each other. Throws UsageError.
void check(const ObserverCommand& command);

}  // namespace sprag
