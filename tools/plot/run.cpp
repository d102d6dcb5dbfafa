#include "tools/plot/run.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "command_line/program.h"
#include "sprag/files/csv.h"
#include "sprag/mechanics/scene.h"
#include "tools/plot/gnuplot.h"

namespace sprag::plot {
namespace {

Figure::Zoom zoom_of(const std::string& text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::optional<double> from = parse_double(text.substr(0, colon));
  const std::optional<double> to =
      colon < text.size() ? parse_double(text.substr(colon + 1)) : std::nullopt;
  if (!from || !to || !(*from < *to)) {
    throw UsageError("--zoom: " + text + " is not allowed; must be FROM:TO, two numbers that rise");
  }
  return {*from, *to};
}

}  // namespace

int run_plot(const PlotRun& run, const CommonOptions& common, nlohmann::ordered_json& report) {
  std::optional<Scene> scene;
  std::vector<Table> tables;
  bool whole = true;
  const auto is_scene = [](const std::string& text) {
    return file_of(text).extension() == ".toml";
  };
  for (const std::string& text : run.files) {
    if (!is_scene(text)) continue;
    if (scene) throw UsageError(text + " is a second scene; a picture is of one machine");
    scene = load_scene(file_of(text), common);
  }
  for (const std::string& text : run.files) {
    if (is_scene(text)) continue;
    const std::filesystem::path file = file_of(text);
    tables.push_back(read_table(text));
    if (const auto& damage = tables.back().damage) {
      const std::string what =
          file.string() + ":" + std::to_string(damage->line) + ": " + damage->what;
      std::cerr << what << "; everything before it is shown\n";
      report["damage"].push_back(what);
      whole = false;
    }
  }
  if (tables.empty()) throw UsageError("no CSV file is given");
  FigureOptions options = run.figure;
  if (!run.zoom.empty()) options.zoom = zoom_of(run.zoom);
  std::vector<std::string> left_out;
  std::string script;
  try {
    const Figure figure = make_figure(tables, scene ? &*scene : nullptr, options, left_out);
    script = gnuplot_script(figure, run.output);
    for (const Panel& panel : figure.panels) report["panels"].push_back(panel.name);
  } catch (const std::invalid_argument& e) {
    throw UsageError(e.what());
  }
  if (!left_out.empty()) {
    std::cerr << "not shown:";
    for (const std::string& name : left_out) std::cerr << ' ' << name;
    std::cerr << "; --show NAME,... chooses\n";
  }
  run_gnuplot(script);
  return whole ? exit_done : exit_failed;
}

}  // namespace sprag::plot
