// work_precision: accuracy against cost of each method, on scenes with a known motion.
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "studies/work_precision/run.h"

int main(int argc, char** argv) {
  CLI::App app(
      "Measures accuracy and cost of simulation methods on scenes whose motion is known, into "
      "work_precision.csv.",
      "work_precision");
  sprag::CommonOptions common;
  sprag::work_precision::Options options;
  options.limits.stop = sprag::stop_requested;
  // Chaos changes the errors, but not the cost per unit of time.
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
    report["rows"] = sprag::work_precision::run(options);
    return sprag::exit_done;
  });
}
