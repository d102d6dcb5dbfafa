#include "studies/work_precision/run.h"

#include <algorithm>
#include <iostream>

#include "command_line/program.h"
#include "sprag/scene_file.h"
#include "studies/work_precision/results.h"

namespace sprag::work_precision {
namespace {

/// The requested names of `all`, in the order of `all`; all of them if none is requested.
std::vector<std::string> chosen(const std::vector<std::string>& asked,
                                const std::vector<std::string>& all, const std::string& option) {
  for (const std::string& name : asked) {
    if (std::find(all.begin(), all.end(), name) == all.end()) {
      throw UsageError(option + ": " + choose(name, all));
    }
  }
  if (asked.empty()) return all;
  std::vector<std::string> result;
  std::copy_if(all.begin(), all.end(), std::back_inserter(result), [&](const std::string& name) {
    return std::find(asked.begin(), asked.end(), name) != asked.end();
  });
  return result;
}

std::vector<double> settings(const Method& method, bool quick) {
  const std::vector<double>& all = method.settings;
  if (!quick || all.size() < 3) return all;
  return {all.front(), all[all.size() / 2]};
}

struct Row {
  const Method* method;
  double setting;
  Measurement measurement;
};

// Every row is measured twice unless it is expensive. A shared machine has slow minutes, and the
// rows of a scene are compared with each other.
constexpr double dear = 2e4;  // CPU us per unit of time

void time_again(Row& row, const Options& options, const Scene& scene, const Reference& truth) {
  double& shortest = row.measurement.figures.cpu_us_per_time;
  if (!row.measurement.failure.empty() || !(shortest < dear)) return;
  const Measurement again =
      measure(*row.method, row.setting, scene.model, scene.truth.start, truth, options.limits);
  if (again.failure.empty()) shortest = std::min(shortest, again.figures.cpu_us_per_time);
}

std::vector<Row> first_round(const Options& options, const std::string& name,
                             const std::vector<std::string>& asked, const Scene& scene,
                             const Reference& truth) {
  std::vector<Row> rows;
  for (const Method& method : methods()) {
    if (std::find(asked.begin(), asked.end(), method.name) == asked.end()) continue;
    for (const double setting : settings(method, options.quick)) {
      std::cerr << name << ", " << method.name << ", " << method.knob << " " << setting << ": ";
      const Measurement measurement =
          measure(method, setting, scene.model, scene.truth.start, truth, options.limits);
      if (stop_requested()) {
        std::cerr << "stopped\n";
        return rows;
      }
      rows.push_back({&method, setting, measurement});
      const Figures& figures = measurement.figures;
      std::cerr << figures.impacts.found << " found, " << figures.impacts.missed << " missed, "
                << figures.cpu_us_per_time << " us per s"
                << (measurement.failure.empty() ? "" : "; failed: " + measurement.failure) << '\n';
    }
  }
  return rows;
}

void measure_scene(const Options& options, const std::string& name,
                   const std::vector<std::string>& asked, Results& results) {
  const Scene scene = read_scene(options.scene_directory / (name + ".toml"));
  const Reference truth = reference(scene, options.reference_directory);
  for (Row& row : first_round(options, name, asked, scene, truth)) {
    if (!options.quick && !stop_requested()) time_again(row, options, scene, truth);
    results.add(name, *row.method, row.setting, row.measurement);
  }
}

}  // namespace

std::size_t run(Options options) {
  if (options.quick) options.limits.timing = 0.03;
  const auto known = reference_scenes();
  const auto scenes = chosen(options.scenes, {known.begin(), known.end()}, "--scene");
  std::vector<std::string> names;
  for (const Method& method : methods()) names.emplace_back(method.name);
  const auto asked = chosen(options.methods, names, "--method");
  std::filesystem::create_directories(options.out);
  Results results(options.out);
  for (const std::string& scene : scenes) {
    if (!stop_requested()) measure_scene(options, scene, asked, results);
  }
  return results.rows();
}

}  // namespace sprag::work_precision
