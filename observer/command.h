// Command line of the observer.
#pragma once

#include <filesystem>
#include <optional>

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
  std::optional<EstimatorKind> estimator;  ///< as given; none: by the stepper
  bool smooth = false;
};

/// Adds all options but the common ones. Parsing fills `command`, which must outlive `app`.
void add_observer_options(CLI::App& app, CommonOptions& common, ObserverCommand& command);

/// Sets options.estimator and checks options that depend on each other. Throws UsageError.
void complete(ObserverCommand& command);

}  // namespace sprag
