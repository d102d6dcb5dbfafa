// posterior: compares the timing filter with the exact posterior of the state, given the reported
// times of the impacts.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "studies/calibration/machines.h"
#include "studies/posterior/study.h"

namespace {

using namespace sprag::posterior;

void run(const std::vector<std::string>& names, const std::vector<double>& jitters,
         const Options& options) {
  std::printf(
      "scene               jitter  seeds instants (skipped) | filter: z2  >3s %%  | exact: z2  "
      ">3s %%  | sigma ratio  mean off\n");
  for (const std::string& name : names) {
    for (const sprag::Scene& scene : sprag::calibration::machines(name)) {
      for (const double jitter : jitters) {
        const Comparison of = compare(scene, jitter, options);
        std::printf("%-19s %-7g %-5d %-8d %-9d | %-10.3g %-6.3g | %-9.3g %-6.3g | %-12.3g %.3g\n",
                    scene.name.c_str(), jitter, options.seeds, of.instants, of.skipped,
                    of.filter.mean_square(), 100.0 * of.filter.beyond(), of.exact.mean_square(),
                    100.0 * of.exact.beyond(), of.sigma_ratio, of.mean_off);
        std::fflush(stdout);
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Holds the timing filter against the exact posterior of the state, which a random walk draws "
      "from with the master alone. SCENE is as of calibration; a machine that is hit and does not "
      "rest.",
      "posterior");
  std::vector<std::string> scenes;
  std::vector<double> jitters{1e-3};
  Options options;
  app.add_option("SCENE", scenes)->required();
  app.add_option("--jitter", jitters, "Standard deviations of event times [s]")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--seeds", options.seeds, "Runs")->check(CLI::PositiveNumber);
  app.add_option("--instants", options.instants, "In the second half of each run")
      ->check(CLI::PositiveNumber);
  app.add_option("--window", options.window, "Impacts before each")->check(CLI::PositiveNumber);
  app.add_option("--steps", options.steps, "Of a walk")->check(CLI::PositiveNumber);
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  return sprag::run_program(argc, argv, app, {}, [&](nlohmann::ordered_json&) {
    run(scenes, jitters, options);
    return sprag::exit_done;
  });
}
