// report: one page to hand in, of the files that the programs write.
#include "command_line/program.h"
#include "tools/plot/table.h"
#include "tools/report/run.h"

int main(int argc, char** argv) {
  using sprag::report::Format;
  const auto app = sprag::command_line(
      "Writes a run or an identification as one page to hand in. It has the verdict, machine, "
      "measurement, parameters, residuals, gaps, impacts, bound, inconsistencies, versions and "
      "command lines, and needs no network and no script.",
      "report");
  sprag::CommonOptions common;
  sprag::report::ReportRun run;
  sprag::add_common_options(*app, common);
  sprag::add_inputs(*app, common, "FILE", run.files, sprag::plot::file_of,
                    "SCENE.toml, or the name of a scene, and any of [LABEL=]FILE: the CSV files of "
                    "master_sim, observer and sync_logger, the JSON of --report, and that of "
                    "identify --json");
  sprag::require(sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written,
                                 run.output, "F", "The report: F.html or F.pdf"));
  sprag::add_choice(*app, "--format", run.format, {{"html", Format::html}, {"pdf", Format::pdf}},
                    "Format [as the output's name ends]. pdf needs chromium");
  sprag::add_finite(*app, "--from", run.shown.from, "T", "Show the time from here on [s]");
  sprag::add_finite(*app, "--to", run.shown.to, "T", "Show the time up to here [s]");
  sprag::add_text(*app, "--title", run.title, "TEXT", "Title [the scene's name]");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::report::run_report(run, common, report);
  });
}
