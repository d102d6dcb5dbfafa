// observer: estimates a machine's full state from the times at which its contacts close and open,
// live or from a recording. The real-time loop is RealTimeLoop::run() in real_time_loop.cpp.
#include <optional>

#include "command_line/program.h"
#include "observer/live.h"
#include "observer/replay.h"
#include "observer/smoothing.h"
#include "sprag/scene.h"

namespace {

sprag::EstimatorKind choose_estimator(std::optional<sprag::EstimatorKind> given,
                                      sprag::StepperKind stepper) {
  using enum sprag::EstimatorKind;
  if (stepper == sprag::StepperKind::exact) return given.value_or(both);
  if (given.value_or(replica) != replica) {
    throw sprag::UsageError(
        "--stepper moreau: a timing filter needs the exact one; choose "
        "--estimator replica");
  }
  return replica;
}

}  // namespace

int main(int argc, char** argv) {
  using Use = sprag::NamedFile::Use;
  const auto app =
      sprag::command_line("Reconstructs a machine's state from its contact events.", "observer");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  sprag::ObserverOptions options;
  sprag::ReplayOptions replay;
  std::filesystem::path scene;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, scene);
  sprag::add_positive(*app, "--duration", options.duration, "T",
                      "Stop when this simulated time has settled");
  sprag::add_positive(*app, "--tick", options.tick, "h", "Tick, simulated time [1e-3]");
  sprag::add_choice<sprag::StepperKind>(
      *app, "--stepper", options.stepper,
      {{"exact", sprag::StepperKind::exact}, {"moreau", sprag::StepperKind::moreau}},
      "exact (events at their own times) or moreau (of the replica alone)");
  std::optional<sprag::EstimatorKind> estimator;
  sprag::add_choice<std::optional<sprag::EstimatorKind>>(
      *app, "--estimator", estimator,
      {{"replica", sprag::EstimatorKind::replica},
       {"timing", sprag::EstimatorKind::timing},
       {"both", sprag::EstimatorKind::both},
       {"adaptive", sprag::EstimatorKind::adaptive}},
      "replica (clutches switched by the events), timing (event times as measurements), both "
      "(timing as long as it fits, else replica) or adaptive (parameters as well, see [adapt]) "
      "[both; with --stepper moreau: replica]");
  auto* states = sprag::add_file(*app, common, "--states", Use::written, options.states, "F.csv",
                                 "Write the settled ticks here");
  auto* impacts =
      sprag::add_file(*app, common, "--impacts", Use::written, options.impacts, "F.csv",
                      "Write velocities, impulse and force of each settled event here, with sigma; "
                      "live, publish them too");
  auto* predict = sprag::add_positive(*app, "--predict", options.predict, "T",
                                      "After each settled event, foresee the next ones within T, "
                                      "with sigma; live, publish them");
  auto* predictions =
      sprag::add_file(*app, common, "--predictions", Use::written, options.predictions, "F.csv",
                      "With --predict: write the predictions here");
  sprag::needs(predictions, predict);
  sprag::add_positive(*app, "--history", options.history, "T",
                      "Simulated time of ticks that are kept to go back to [2]");
  sprag::add_flag(*app, "--realtime", options.real_time,
                  "SCHED_FIFO and locked memory, where permitted");
  auto* file = sprag::add_file(*app, common, "--replay", Use::read, replay.file, "FILE",
                               "Replay an LCM log or an events CSV, offline");
  auto* events = sprag::add_file(*app, common, "--events", Use::written, replay.events, "F.csv",
                                 "With --replay: write the events used here");
  sprag::needs(events, file);
  bool smooth = false;
  auto* smoothing = sprag::add_flag(*app, "--smooth", smooth,
                                    "With --replay and --states: every event speaks for the whole "
                                    "path");
  sprag::needs(smoothing, file);
  sprag::needs(smoothing, states);
  sprag::excludes(smoothing, events);
  sprag::excludes(smoothing, impacts);
  sprag::excludes(smoothing, predict);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene parsed = sprag::load_scene(scene, common);
    options.estimator = choose_estimator(estimator, options.stepper);
    if (options.stepper == sprag::StepperKind::moreau && !options.impacts.empty()) {
      throw sprag::UsageError(
          "--stepper moreau: events act in the tick they fall in, so that --impacts has nothing to "
          "say; choose --stepper exact");
    }
    if (options.predict > 0.0) {
      if (options.estimator == sprag::EstimatorKind::replica ||
          options.estimator == sprag::EstimatorKind::adaptive) {
        throw sprag::UsageError(
            "--predict: only a timing filter of the scene's own parameters knows how sure it is of "
            "the events to come; choose --estimator both or timing");
      }
      if (!replay.file.empty() && options.predictions.empty()) {
        throw sprag::UsageError("--predict with --replay: say where to with --predictions F.csv");
      }
    }
    if (smooth) {
      if (options.estimator == sprag::EstimatorKind::adaptive ||
          options.estimator == sprag::EstimatorKind::replica) {
        throw sprag::UsageError("--smooth: the smoother is a timing filter's; leave --estimator");
      }
      return sprag::run_smoothing(parsed, options, replay, common, report);
    }
    return replay.file.empty() ? sprag::run_live(parsed, options, common, report)
                               : sprag::run_replay(parsed, options, replay, common, report);
  });
}
