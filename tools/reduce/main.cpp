// reduce: reduces a scene to its first modes, with the correction for the other modes that recorded
// contact events select.
#include "command_line/program.h"
#include "tools/reduce/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Writes a scene in its first modes, with that correction for the modes that are left out "
      "with "
      "which it follows recorded contact events best.",
      "reduce");
  sprag::CommonOptions common;
  sprag::ReduceRun run;
  sprag::add_common_options(*app, common);
  sprag::add_file(*app, common, "EVENTS", sprag::NamedFile::Use::read, run.events, "",
                  "LCM log or events CSV");
  sprag::add_scene(*app, common, run.scene);
  sprag::require(sprag::add_count(*app, "--modes", run.modes, "n", "Modes to keep, by frequency"));
  sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written, run.output,
                  "REDUCED.toml", "Write the reduced scene to this file");
  sprag::add_flag(*app, "--json", run.json, "Print one JSON object");
  sprag::add_positive(*app, "--duration", run.duration, "T",
                      "Leave out events after this time [s]");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::run_reduce(run, common, report);
  });
}
