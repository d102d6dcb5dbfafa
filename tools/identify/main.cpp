// identify: finds the parameters of a scene's machine from the times of its contact events.
#include "command_line/program.h"
#include "tools/identify/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Finds the parameters of a scene's machine from the times of its contact events alone, with "
      "standard deviations, and reports which of them explain the events. Exit code 0: the events "
      "fit with the identified parameters, 3: they do not, 1: too few of them.",
      "identify");
  sprag::CommonOptions common;
  sprag::IdentifyRun run;
  double jitter = 0.0;
  sprag::add_common_options(*app, common);
  sprag::add_file(*app, common, "LOG", sprag::NamedFile::Use::read, run.log, "",
                  "LCM log or events CSV");
  sprag::add_scene(*app, common, run.scene);
  sprag::add_text(*app, "--free", run.sought.free, "NAME,...",
                  "Parameters that are sought, by their keys in the scene, or all");
  CLI::Option* known =
      sprag::add_text(*app, "--known", run.sought.known, "NAME,...",
                      "Parameters that are correct; a known clearance also sets the scale");
  CLI::Option* within =
      sprag::add_text(*app, "--within", run.sought.within, "SHARE",
                      "How far each may be off, default 0.2; NAME=SHARE,... of single ones");
  sprag::add_positive(*app, "--jitter", jitter, "SIGMA",
                      "Standard deviation of the event times [s], in place of the scene's; without "
                      "either it is found");
  sprag::add_positive(*app, "--duration", run.duration, "T",
                      "Leave out events after this time [s]");
  CLI::Option* output =
      sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written, run.output,
                      "FITTED.toml", "Write the scene with the fitted values, its comments kept");
  CLI::Option* mended = sprag::add_file(
      *app, common, "--events", sprag::NamedFile::Use::written, run.events, "MENDED.csv",
      "Write the events as they were used: lost ones inserted, spurious ones marked");
  CLI::Option* accept =
      sprag::add_flag(*app, "--accept", run.accept,
                      "Take what does not fit as an effective model, what is left as its jitter");
  CLI::Option* no_limit =
      sprag::add_flag(*app, "--no-drift-limit", run.no_drift_limit,
                      "Where no drift is found, write none: not its 95 % limit");
  CLI::Option* each = sprag::add_flag(
      *app, "--each", run.each, "One parameter at a time: which of them alone explains the events");
  for (CLI::Option* other : {known, within, output, mended, accept, no_limit}) {
    sprag::excludes(each, other);
  }
  sprag::add_flag(*app, "--json", run.json, "Print one JSON object");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    if (jitter > 0.0) run.jitter = jitter;
    return sprag::run_identify(run, common, report);
  });
}
