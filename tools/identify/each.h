// One unknown at a time: whether the events fit the scene and which parameter would explain them.
#pragma once

#include "tools/identify/run.h"

namespace sprag {

/// Reads the events, prints the diagnosis to standard output, fills `report` and returns the exit
/// code: that of a failure if the file is damaged. Throws as run_identify().
int run_each(const IdentifyRun& run, const Scene& scene, const CommonOptions& common,
             nlohmann::ordered_json& report);

}  // namespace sprag
