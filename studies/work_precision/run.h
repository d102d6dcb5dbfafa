// One run of work_precision: the chosen methods at their settings on the chosen scenes.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "studies/work_precision/measure.h"

namespace sprag::work_precision {

struct Options {
  std::vector<std::string> scenes, methods;  ///< none: all
  std::filesystem::path scene_directory = SPRAG_SOURCE_DIR "/scenes";
  std::filesystem::path reference_directory = SPRAG_SOURCE_DIR "/tests/reference";
  std::filesystem::path out = ".";
  Limits limits;
  bool quick = false;  ///< two settings per method, short timing
};

/// Writes work_precision.csv into `out` row by row, and reports progress on
/// stderr. Returns the number of rows. Throws UsageError for an unknown name and SceneError for a
/// scene that cannot be read.
std::size_t run(Options options);

}  // namespace sprag::work_precision
