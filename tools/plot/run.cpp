#include "tools/plot/run.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "command_line/printable.h"
#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/scene.h"
#include "tools/plot/gnuplot.h"
#include "tools/plot/script_text.h"

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

void note_damage(const std::filesystem::path& file, const FileProblem& damage,
                 nlohmann::ordered_json& report) {
  const std::string what = file.string() + ":" + std::to_string(damage.line) + ": " + damage.what;
  std::cerr << what << "; the picture shows everything before it\n";
  report["damage"].push_back(what);
}

// Throws if the output would overwrite a manifest, which is read although no option names it.
void keep_manifest(const std::filesystem::path& manifest, const CommonOptions& common) {
  std::vector<NamedFile> files{{"the manifest of FILE", manifest, NamedFile::Use::read}};
  for (const auto& file : common.files) files.push_back(file());
  if (const std::string clash = overwritten(files); !clash.empty()) throw OverwriteError(clash);
}

int plot_study(const PlotRun& run, const CommonOptions& common, nlohmann::ordered_json& report) {
  std::vector<std::filesystem::path> files;
  for (const std::string& text : run.files) {
    files.push_back(file_of(text));
    if (!is_study(files.back())) {
      throw UsageError(text + " holds no rows of a study; a picture is of a study or of runs");
    }
    keep_manifest(manifest_of(files.back()), common);
  }
  const StudyTable table = read_study_table(files);
  if (table.damage) note_damage(files.back(), *table.damage, report);
  StudyOptions options = run.study;
  options.title = run.figure.title;
  options.show = run.figure.show;
  std::string script;
  try {
    const StudyFigure figure = make_study_figure(table, options);
    script = study_script(figure, run.output);
    for (const StudyPanel& panel : figure.panels) report["panels"].push_back(panel.name);
  } catch (const std::invalid_argument& e) {
    throw UsageError(e.what());
  }
  write_file(run.output, drawn(script));
  return table.damage ? exit_failed : exit_done;
}

}  // namespace

int run_plot(const PlotRun& run, const CommonOptions& common, nlohmann::ordered_json& report) {
  if (std::any_of(run.files.begin(), run.files.end(),
                  [](const std::string& text) { return is_study(file_of(text)); })) {
    return plot_study(run, common, report);
  }
  std::optional<Scene> scene;
  std::vector<Table> tables;
  bool whole = true;
  const auto is_scene = [](const std::string& text) {
    const std::filesystem::path file = file_of(text);
    std::error_code error;  // the name may be too long
    return file.extension() == ".toml" || (file.extension().empty() && !exists(file, error));
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
    if (tables.back().kind == TableKind::predictions) {
      throw UsageError(text + " holds predictions, which plot does not draw; report does");
    }
    if (const auto& damage = tables.back().damage) {
      note_damage(file, *damage, report);
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
    for (const std::string& name : left_out) std::cerr << ' ' << printable(name);
    std::cerr << "; --show NAME,... chooses\n";
  }
  write_file(run.output, drawn(script));
  return whole ? exit_done : exit_failed;
}

}  // namespace sprag::plot
