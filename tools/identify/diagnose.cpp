// diagnose: identify --each, by a name of its own.
#include "command_line/program.h"
#include "tools/identify/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Reports whether contact events fit a scene's machine and, if not, which value of which "
      "single parameter would explain them. Exit code 0: they fit, 3: they do not.",
      "diagnose");
  sprag::CommonOptions common;
  sprag::IdentifyRun run;
  run.each = true;
  double jitter = 0.0;
  sprag::add_common_options(*app, common);
  sprag::add_file(*app, common, "LOG", sprag::NamedFile::Use::read, run.log, "",
                  "LCM log or events CSV");
  sprag::add_scene(*app, common, run.scene);
  sprag::add_text(*app, "--free", run.sought.free, "NAME,...",
                  "Parameters that may be wrong, by their keys in the scene, or all");
  sprag::add_flag(*app, "--json", run.json, "Print one JSON object");
  sprag::add_positive(*app, "--jitter", jitter, "SIGMA",
                      "Standard deviation of the event times [s], in place of the scene's");
  sprag::add_positive(*app, "--duration", run.duration, "T",
                      "Leave out events after this time [s]");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    if (jitter > 0.0) run.jitter = jitter;
    return sprag::run_identify(run, common, report);
  });
}
