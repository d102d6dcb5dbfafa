#include "tools/tolerance/run.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "command_line/scene_inputs.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/detail/tolerance/search.h"
#include "sprag/reduction.h"
#include "tools/plot/script_text.h"
#include "tools/tolerance/chart.h"
#include "tools/tolerance/modes.h"
#include "tools/tolerance/print.h"

namespace sprag::tolerance {
namespace {

std::vector<EstimatorKind> estimators_named(const std::vector<std::string>& names) {
  const std::vector<EstimatorKind> usual = Settings{}.estimators;
  std::vector<EstimatorKind> all = usual;
  all.push_back(EstimatorKind::adaptive);
  std::vector<EstimatorKind> kinds;
  for (const std::string& name : names) {
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](EstimatorKind kind) { return study::name(kind) == name; });
    if (found == all.end()) {
      std::vector<std::string> choices;
      for (const EstimatorKind kind : all) choices.emplace_back(study::name(kind));
      throw UsageError("--estimator: " + choose(name, choices));
    }
    kinds.push_back(*found);
  }
  return kinds.empty() ? usual : kinds;
}

// Prints the progress, `part` from 0 to 1, on a terminal only.
void show_progress(double part) {
  static int last = -1;
  const int percent = static_cast<int>(100.0 * part);
  if (::isatty(STDERR_FILENO) != 1 || percent == last) return;
  last = percent;
  std::fprintf(stderr, "\r%3d %%%s", percent, percent == 100 ? "\n" : "");
}

}  // namespace

int run_tolerance(ToleranceRun run, const CommonOptions& common, nlohmann::ordered_json& report) {
  const Scene scene = load_scene(run.scene, common);
  require_inputs_until(scene, run.settings.duration, "--duration");
  run.settings.estimators = estimators_named(run.estimators);
  const auto& chosen = run.settings.estimators;
  if (run.modes &&
      std::find(chosen.begin(), chosen.end(), EstimatorKind::adaptive) != chosen.end()) {
    throw UsageError(
        "--modes: adaptive seeks keys of the whole scene; choose replica, timing or both");
  }
  if (!run.output.empty()) check_picture(run.output);
  std::optional<OutputFile> csv;
  if (!run.csv.empty()) csv.emplace(run.csv);
  if (csv && !csv->good()) throw std::runtime_error(csv->error());
  const int cores = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1U));
  const int threads = run.jobs > 0 ? run.jobs : cores;

  nlohmann::ordered_json object;
  const auto conclude = [&](const Bench& bench, const auto& found) {
    write_json(bench, found, object);
    print_result(object, to_text(bench, found), run.json, report);
    if (csv) {
      csv->write(to_csv(bench, found));
      if (!csv->close()) throw std::runtime_error(csv->error());
    }
    if (!run.output.empty()) {
      write_file(run.output, plot::drawn(chart_script(bench, found, run.output)));
    }
  };
  if (run.modes) {
    const Bench bench(in_modes(scene, 0), run.settings, threads);
    conclude(bench, fewer_modes(bench, threads, show_progress));
  } else {
    const Bench bench(scene, run.settings, threads);
    conclude(bench,
             search(bench, deviations_of(bench.scene(), bench.closings_per_time()), threads,
                    [](int round, double done) { show_progress(0.5 * (round - 1 + done)); }));
  }
  return exit_done;
}

}  // namespace sprag::tolerance
