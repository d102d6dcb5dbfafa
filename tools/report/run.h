// report: reads the files of a run and writes them as one page to hand in.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "tools/report/sections.h"

namespace sprag::report {

enum class Format { by_name, html, pdf };

struct ReportRun {
  std::vector<std::string> files;  ///< [LABEL=]FILE in any order, exactly one of them a scene
  std::filesystem::path output;
  Format format = Format::by_name;  ///< by_name: .html or .pdf of `output`
  std::string title;                ///< empty: the scene's name
  Shown shown;
};

/// Writes the report and returns the exit code, exit_failed if a file is damaged. Throws
/// UsageError, InputError, SceneError, and std::runtime_error if gnuplot or the conversion to PDF
/// fails.
int run_report(const ReportRun& run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag::report
