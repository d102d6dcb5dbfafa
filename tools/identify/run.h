// identify: reads the events, fits the scene to them, prints, and writes the fitted scene.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "command_line/program.h"
#include "tools/identify/options.h"

namespace sprag {

inline constexpr int exit_not_identified = 3;  ///< the fit was refused, no failure

struct IdentifyRun {
  std::filesystem::path log, scene, output, events;
  SoughtOptions sought;
  bool json = false;
  bool accept = false;
  bool each = false;             ///< one unknown at a time, see each.h
  bool no_drift_limit = false;   ///< set: if no drift was found, no upper limit is written
  std::optional<double> jitter;  ///< [s]; empty: the scene's
  double duration = std::numeric_limits<double>::infinity();  ///< later events are ignored [s]
};

/// Prints to standard output, fills `report` and returns the exit code: that of a failure if the
/// file is damaged. Throws SceneError, InputError, ModelError, UsageError, and std::runtime_error
/// (too few events, output that cannot be written).
int run_identify(const IdentifyRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report);

}  // namespace sprag
