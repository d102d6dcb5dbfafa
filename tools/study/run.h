// study: computes the runs of a study file into a folder.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "command_line/program.h"
#include "tools/study/ranks.h"

namespace sprag::study {

struct StudyRun {
  std::filesystem::path study;
  std::filesystem::path output;  ///< empty: the study's name
  std::string shard;             ///< "i/n"; empty: the whole study
  int jobs = 0;                  ///< threads; 0: the number of cores
  int chunk = 0;                 ///< runs handed out together; 0: as many as take about a second
};

/// Returns the exit code. Only rank 0 writes a report. Throws UsageError, InputError, SceneError,
/// std::runtime_error, or Interrupted.
int run_study(const StudyRun& run, Ranks& ranks, CommonOptions& common,
              nlohmann::ordered_json& report);

}  // namespace sprag::study
