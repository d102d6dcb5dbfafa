// observer: a machine's full state, live, from nothing but the times at which its contacts close
// and open. The real-time loop is LiveObserver::integrate() in live.cpp.
#include "lcmtypes/program.h"
#include "mechanics/scene.h"
#include "observer/live.h"
#include "observer/replay.h"

int main(int argc, char** argv) {
  CLI::App app("Reconstructs a machine's state from its contact events.", "observer");
  sprag::CommonOptions common;
  sprag::ObserverOptions options;
  sprag::ReplayOptions replay;
  std::string scene;
  sprag::add_common_options(app, common);
  app.add_option("SCENE", scene, "Scene file (TOML)")->required();
  sprag::add_positive(app, "--duration", options.duration, "T",
                      "Stop when this simulated time has settled");
  sprag::add_positive(app, "--tick", options.tick, "h", "Tick, simulated time [1e-3]");
  auto* stepper =
      app.add_option("--stepper", options.stepper, "exact (events at their own times) or moreau")
          ->transform(CLI::CheckedTransformer(std::map<std::string, sprag::StepperKind>{
              {"exact", sprag::StepperKind::exact}, {"moreau", sprag::StepperKind::moreau}}))
          ->type_name("exact|moreau");
  app.add_option(
         "--estimator", options.estimator,
         "replica (clutches switched by the events), timing (event times as measurements) or both "
         "(timing as long as it fits, else replica)")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, sprag::EstimatorKind>{{"replica", sprag::EstimatorKind::replica},
                                                      {"timing", sprag::EstimatorKind::timing},
                                                      {"both", sprag::EstimatorKind::both}}))
      ->type_name("replica|timing|both")
      ->excludes(stepper);
  app.add_option("--states", options.states, "Write the settled ticks here")->type_name("F.csv");
  sprag::add_positive(app, "--history", options.history, "T",
                      "Simulated time of ticks that are kept to go back to [2]");
  app.add_flag("--realtime", options.real_time, "SCHED_FIFO and locked memory, where permitted");
  auto* file =
      app.add_option("--replay", replay.file, "Replay an LCM log or an events CSV, offline")
          ->type_name("FILE");
  app.add_option("--events", replay.events, "With --replay: write the events used here")
      ->type_name("F.csv")
      ->needs(file);

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene parsed = sprag::read_scene(scene);
    return replay.file.empty() ? sprag::run_live(parsed, options, common, report)
                               : sprag::run_replay(parsed, options, replay, common, report);
  });
}
