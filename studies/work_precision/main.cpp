// work_precision: what accuracy each method buys with how much work, on scenes whose motion is
// known.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/files/scene_file.h"
#include "studies/work_precision/results.h"

namespace {

namespace wp = sprag::work_precision;

struct Options {
  std::vector<std::string> scenes, methods;
  std::filesystem::path scene_directory = SPRAG_SOURCE_DIR "/scenes";
  std::filesystem::path reference_directory = SPRAG_SOURCE_DIR "/tests/reference";
  std::filesystem::path out = ".";
  wp::Limits limits;
  bool quick = false;
};

/// Which of `all` the user asked for, in the order of `all`; all if none.
std::vector<std::string> chosen(const std::vector<std::string>& asked,
                                const std::vector<std::string>& all, const std::string& option) {
  for (const std::string& name : asked) {
    if (std::find(all.begin(), all.end(), name) == all.end()) {
      throw sprag::UsageError(option + ": " + sprag::choose(name, all));
    }
  }
  if (asked.empty()) return all;
  std::vector<std::string> result;
  std::copy_if(all.begin(), all.end(), std::back_inserter(result), [&](const std::string& name) {
    return std::find(asked.begin(), asked.end(), name) != asked.end();
  });
  return result;
}

std::vector<double> settings(const wp::Method& method, bool quick) {
  const std::vector<double>& all = method.settings;
  if (!quick || all.size() < 3) return all;
  return {all.front(), all[all.size() / 2]};
}

struct Row {
  const wp::Method* method;
  double setting;
  wp::Measurement measurement;
};

// Every row twice, unless it is dear: a machine that is shared has slow minutes, and the rows of a
// scene are to be compared with each other.
constexpr double dear = 2e4;  // CPU us per unit of time

void time_again(Row& row, const Options& options, const sprag::Scene& scene,
                const wp::Reference& reference) {
  double& shortest = row.measurement.figures.cpu_us_per_time;
  if (!row.measurement.failure.empty() || !(shortest < dear)) return;
  const wp::Measurement again =
      wp::measure(*row.method, row.setting, scene.model, scene.master, reference, options.limits);
  if (again.failure.empty()) shortest = std::min(shortest, again.figures.cpu_us_per_time);
}

std::vector<Row> first_round(const Options& options, const std::string& name,
                             const std::vector<std::string>& methods, const sprag::Scene& scene,
                             const wp::Reference& reference) {
  std::vector<Row> rows;
  for (const wp::Method& method : wp::methods()) {
    if (std::find(methods.begin(), methods.end(), method.name) == methods.end()) continue;
    for (const double setting : settings(method, options.quick)) {
      std::cerr << name << ", " << method.name << ", " << method.knob << " " << setting << ": ";
      const wp::Measurement measurement =
          wp::measure(method, setting, scene.model, scene.master, reference, options.limits);
      if (sprag::stop_requested()) {
        std::cerr << "stopped\n";
        return rows;
      }
      rows.push_back({&method, setting, measurement});
      const wp::Figures& figures = measurement.figures;
      std::cerr << figures.impacts.found << " found, " << figures.impacts.missed << " missed, "
                << figures.cpu_us_per_time << " us per s"
                << (measurement.failure.empty() ? "" : "; failed: " + measurement.failure) << '\n';
    }
  }
  return rows;
}

void measure_scene(const Options& options, const std::string& name,
                   const std::vector<std::string>& methods, wp::Results& results) {
  const sprag::Scene scene = sprag::read_scene(options.scene_directory / (name + ".toml"));
  const wp::Reference reference = wp::reference(scene, options.reference_directory);
  for (Row& row : first_round(options, name, methods, scene, reference)) {
    if (!options.quick && !sprag::stop_requested()) time_again(row, options, scene, reference);
    results.add(name, *row.method, row.setting, row.measurement);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Measures accuracy and cost of simulation methods on scenes whose motion is known, into "
      "work_precision.csv and work_precision.json.",
      "work_precision");
  sprag::CommonOptions common;
  Options options;
  options.limits.stop = sprag::stop_requested;
  // Chaos does not change what a unit of time costs, only what can be said of its errors.
  options.limits.timed_span = 20.0;
  sprag::add_common_options(app, common);
  app.add_option("--scene", options.scenes, "Only these scenes")->type_name("NAME");
  app.add_option("--method", options.methods, "Only these methods")->type_name("NAME");
  app.add_option("--scenes", options.scene_directory, "Where the scene files are")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_option("--reference", options.reference_directory, "Where the references are")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_option("--out", options.out, "Where the files go; made if missing")
      ->type_name("DIR")
      ->capture_default_str();
  sprag::add_positive(app, "--timeout", options.limits.timeout, "SECONDS",
                      "Longest time for one method at one setting (default 60)");
  app.add_flag("--quick", options.quick, "Two settings a method, short timing");

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    if (options.quick) options.limits.timing = 0.03;
    const auto known = wp::reference_scenes();
    const auto scenes = chosen(options.scenes, {known.begin(), known.end()}, "--scene");
    std::vector<std::string> names;
    for (const wp::Method& method : wp::methods()) names.emplace_back(method.name);
    const auto methods = chosen(options.methods, names, "--method");
    std::filesystem::create_directories(options.out);
    wp::Results results(options.out);
    for (const std::string& scene : scenes) {
      if (!sprag::stop_requested()) measure_scene(options, scene, methods, results);
    }
    report["rows"] = results.rows();
    return sprag::exit_done;
  });
}
