// tolerance: finds the largest deviations of a machine for which its observer stays accurate
// enough.
#include "command_line/program.h"
#include "tools/tolerance/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Reports the largest deviations for which V, the energy of the error, stays below a target: "
      "jitter and offset of event times, lost and spurious events, and errors of every parameter "
      "of the scene. The observers are run on the scene's machine with one deviation at a time.",
      "tolerance");
  sprag::CommonOptions common;
  sprag::tolerance::ToleranceRun run;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, run.scene);
  sprag::add_positive(*app, "--target", run.settings.target, "V",
                      "Largest V that is good enough, in the scene's unit of energy [1e-4 of the "
                      "energy of the machine's motion]");
  sprag::add_names(*app, "--estimator", run.estimators, "replica, timing, both [these], adaptive");
  sprag::add_flag(*app, "--modes", run.modes,
                  "In place of that: how few modes an observer needs, without and with a "
                  "correction for the others");
  sprag::add_positive(
      *app, "--jitter", run.settings.jitter, "SIGMA",
      "Standard deviation of event times, in addition to a deviation [the scene's] [s]");
  sprag::add_positive(*app, "--drift", run.settings.drift, "D",
                      "Energy by which filters take their model to depart from the machine, per "
                      "unit of time [the scene's]");
  sprag::add_count(*app, "--runs", run.settings.runs, "n", "Runs of each amount [7]");
  sprag::add_positive(
      *app, "--duration", run.settings.duration, "T",
      "Of a run [twice the time to convergence of the replica, and 200 closings] [s]");
  sprag::add_file(
      *app, common, "--output", sprag::NamedFile::Use::written, run.output, "F",
      "Draw V against every amount, or the error against the modes: .png, .svg or .pdf");
  sprag::add_file(*app, common, "--csv", sprag::NamedFile::Use::written, run.csv, "F.csv",
                  "Write all that was tried");
  sprag::add_flag(*app, "--json", run.json, "Print one JSON object");
  sprag::add_jobs(*app, run.jobs);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::tolerance::run_tolerance(run, common, report);
  });
}
