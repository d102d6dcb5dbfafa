// plot: draws the files that the programs write. The content of pictures is in figure.h.
#include "command_line/program.h"
#include "tools/plot/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Draws states, gaps, contacts and error energies of any run with gnuplot, on one time axis, "
      "with bands of two sigma. Files are distinguished by their headers; those with one LABEL are "
      "one "
      "run and have one colour. With the scene, gaps are shown in place of coordinates. Of a "
      "study's "
      "rows: bands over one key, maps over two, bifurcation diagrams and basins.",
      "plot");
  sprag::CommonOptions common;
  sprag::plot::PlotRun run;
  sprag::plot::FigureOptions& figure = run.figure;
  sprag::add_common_options(*app, common);
  sprag::add_inputs(*app, common, "FILE", run.files, sprag::plot::file_of,
                    "[LABEL=]FILE.csv as master_sim --states and --events, observer --states and "
                    "--impacts and sync_logger --csv write it; SCENE.toml. Or rows.csv of a study, "
                    "or its shards");
  sprag::require(sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written,
                                 run.output, "F", "The picture: F.png, F.svg or F.pdf"));
  sprag::add_names(
      *app, "--show", figure.show,
      "Panels, in this order: names of outputs, keys of parameters, g1, q1, u1, contacts, "
      "V, ... [outputs, parameters and gaps or coordinates that fit, contacts, V]. Of a study: its "
      "quantities");
  sprag::add_names(
      *app, "--over", run.study.over,
      "Of a study: one or two keys that vary, across and up [the keys that it varies]");
  sprag::add_names(*app, "--where", run.study.where,
                   "Of a study: KEY=VALUE, only rows with the value of KEY next to this one");
  sprag::add_finite(*app, "--from", figure.from, "T", "Show the time from here on [s]");
  sprag::add_finite(*app, "--to", figure.to, "T", "Show the time up to here [s]");
  sprag::add_text(*app, "--zoom", run.zoom, "FROM:TO",
                  "Show all but V in this time only, beside it [s]");
  sprag::add_text(*app, "--title", figure.title, "TEXT", "Title [the scene's name]");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::plot::run_plot(run, common, report);
  });
}
