#include "observer/command.h"

#include "sprag/detail/text/confidence_choices.h"

namespace sprag {
namespace {

void add_replay_options(CLI::App& app, CommonOptions& common, ObserverCommand& command) {
  using Use = NamedFile::Use;
  auto* states = add_file(app, common, "--states", Use::written, command.options.states, "F.csv",
                          "Write the settled ticks here");
  auto* impacts = add_file(app, common, "--impacts", Use::written, command.options.impacts, "F.csv",
                           "Write velocities, impulse and force of each settled event here, with "
                           "sigma; live, publish them too");
  auto* predict = add_positive(app, "--predict", command.options.predict, "T",
                               "After each settled event, predict the next ones within T, with "
                               "sigma; live, publish them");
  auto* predictions =
      add_file(app, common, "--predictions", Use::written, command.options.predictions, "F.csv",
               "With --predict: write the predictions here");
  needs(predictions, predict);
  auto* file = add_file(app, common, "--replay", Use::read, command.replay.file, "FILE",
                        "Replay an LCM log or an events CSV, offline");
  auto* events = add_file(app, common, "--events", Use::written, command.replay.events, "F.csv",
                          "With --replay: write the events used here");
  needs(events, file);
  auto* smooth = add_flag(app, "--smooth", command.smooth,
                          "With --replay and --states: estimate each state from all events, "
                          "earlier and later ones");
  needs(smooth, file);
  needs(smooth, states);
  excludes(smooth, events);
  excludes(smooth, impacts);
  excludes(smooth, predict);
}

}  // namespace

void add_observer_options(CLI::App& app, CommonOptions& common, ObserverCommand& command) {
  ObserverOptions& options = command.options;
  add_scene(app, common, command.scene);
  add_positive(app, "--duration", options.duration, "T",
               "Stop when this simulated time has settled");
  add_positive(app, "--tick", options.tick, "h", "Tick, simulated time [1e-3]");
  add_choice<EstimatorKind>(
      app, "--estimator", options.estimator,
      {{"replica", EstimatorKind::replica},
       {"timing", EstimatorKind::timing},
       {"both", EstimatorKind::both},
       {"adaptive", EstimatorKind::adaptive}},
      "replica (clutches switched by the events), timing (event times as measurements), both "
      "(timing as long as it fits, else replica) or adaptive (parameters as well, see [adapt]) "
      "[both]");
  add_choice(app, "--confidence", command.confidence,
             confidence_choices<std::optional<ConfidenceLevel>>(),
             "low, medium or high: how sure the filter must be to be shown [the scene's; high]");
  add_positive(app, "--history", options.history, "T",
               "Simulated time of ticks that are kept to go back to [2]");
  add_flag(app, "--realtime", options.real_time, "SCHED_FIFO and locked memory, where permitted");
  add_flag(app, "--verbose", options.verbose,
           "At the end, print times, messages and the bound as well");
  add_replay_options(app, common, command);
}

void check(const ObserverCommand& command) {
  const ObserverOptions& options = command.options;
  const bool has_filter =
      options.estimator == EstimatorKind::timing || options.estimator == EstimatorKind::both;
  if (options.predict > 0.0 && !has_filter) {
    throw UsageError(
        "--predict: only a timing filter of the scene's own parameters has a sigma of later "
        "events; choose --estimator both or timing");
  }
  if (options.predict > 0.0 && !command.replay.file.empty() && options.predictions.empty()) {
    throw UsageError("--predict with --replay: needs an output, --predictions F.csv");
  }
  if (command.smooth && !has_filter) {
    throw UsageError(
        "--smooth: the smoother runs a timing filter; choose --estimator both or timing");
  }
}

}  // namespace sprag
