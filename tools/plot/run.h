// plot: reads and draws files that other programs have written.
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
  StudyOptions study;  ///< for rows of a study; its title and show are those of `figure`
};

/// Draws the picture, reports omitted panels and damaged files on stderr, and returns the exit
/// code, exit_failed if a file is damaged. Throws UsageError, InputError, SceneError, and
/// std::runtime_error if gnuplot fails.
int run_plot(const PlotRun& run, const CommonOptions& common, nlohmann::ordered_json& report);

}  // namespace sprag::plot
