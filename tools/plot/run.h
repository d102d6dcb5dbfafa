// plot: reads what programs have written and draws it.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "tools/plot/figure.h"
#include "tools/plot/study_figure.h"

namespace sprag::plot {

struct PlotRun {
  std::vector<std::string> files;  ///< [LABEL=]FILE.csv, in any order, and at most one SCENE.toml;
                                   ///< or the rows of one study
  std::filesystem::path output;    ///< .png, .svg or .pdf
  FigureOptions figure;
  std::string zoom;    ///< FROM:TO; empty: none
  StudyOptions study;  ///< of the rows of a study; title and show are the figure's
};

/// Draws, says on stderr which panels were left out and which files are damaged, and returns the
/// exit code: that of a failure if a file is damaged. Throws UsageError, InputError, SceneError,
/// and std::runtime_error where gnuplot fails.
int run_plot(const PlotRun& run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag::plot
