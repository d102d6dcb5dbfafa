#include "tools/report/inputs.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <system_error>

#include "sprag/detail/files/input_file.h"

namespace sprag::report {
namespace {

using plot::TableKind;

constexpr const char* allowed =
    "expected a scene, a CSV of states, events, impacts, predictions or V, or the JSON of --report "
    "or of identify --json";

bool is_scene(const std::filesystem::path& file) {
  std::error_code error;  // the name may be too long
  return file.extension() == ".toml" || (file.extension().empty() && !exists(file, error));
}

bool is_json(const std::filesystem::path& file) {
  InputFile input(file);
  const std::string_view begin = input.ahead(64);
  const std::size_t first = begin.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && begin[first] == '{';
}

// Of identify --json, which does not name its program.
bool is_identification(const Json& content) {
  return content.contains("parameters") && content.contains("problem");
}

JsonFile read_json(const std::string& text, const std::filesystem::path& file) {
  JsonFile result{
      .label = plot::label_of(text), .file = file.string(), .program = {}, .content = {}};
  try {
    result.content = Json::parse(read_whole(file));
  } catch (const Json::parse_error& e) {
    throw InputError(file.string() + ": is no complete JSON, from byte " + std::to_string(e.byte) +
                     " on; " + allowed);
  }
  result.program = text_at(result.content, "/program");
  if (result.program.empty() && is_identification(result.content)) result.program = "identify";
  if (result.program.empty()) {
    throw InputError(file.string() + ": has no key program, so it is no report of a program; " +
                     allowed);
  }
  return result;
}

std::string count(std::size_t n, const char* what) {
  return std::to_string(n) + ' ' + what + (n == 1 ? "" : "s");
}

ReadFile listed(const std::filesystem::path& file, const plot::Table& table) {
  ReadFile read{file.string(), std::string(name(table.kind)), {}};
  if (table.kind == TableKind::states) {
    read.content += is_estimate(table) ? " of an estimate" : " of a machine";
  }
  read.content += ", " + count(table.columns.front().size(), "row");
  if (table.left_out > 0) {
    read.content += ", " + std::to_string(table.left_out) + " marked as spurious and left out";
  }
  if (table.damage) {
    read.damage =
        "damaged from line " + std::to_string(table.damage->line) + " on: " + table.damage->what;
  }
  return read;
}

// Labels by the content where a file has none of its own and the content is clear.
void put_labels(const std::vector<std::string>& texts, std::vector<plot::Table>& tables) {
  const auto estimates = std::count_if(tables.begin(), tables.end(), [](const plot::Table& table) {
    return table.kind == TableKind::states && is_estimate(table);
  });
  for (std::size_t k = 0; k < tables.size(); ++k) {
    plot::Table& table = tables[k];
    if (table.label != plot::file_of(texts[k]).stem().string()) continue;
    if (table.kind == TableKind::states && !is_estimate(table)) {
      table.label = "machine";
    } else if (estimates <= 1 && table.kind != TableKind::events) {
      table.label = "estimate";
    }
  }
}

Scene read_one_scene(const std::vector<std::string>& texts, const CommonOptions& common,
                     std::vector<ReadFile>& files) {
  std::optional<Scene> scene;
  for (const std::string& text : texts) {
    const std::filesystem::path file = plot::file_of(text);
    if (!is_scene(file)) continue;
    if (scene) throw UsageError(text + " is a second scene; a report is of one machine");
    scene = load_scene(file, common);
    files.push_back({file.string(), "scene", {}});
  }
  if (!scene) {
    throw UsageError(
        "no scene is given; name the scene of the run, a file SCENE.toml or one that "
        "`sprag scenes` lists");
  }
  return std::move(*scene);
}

}  // namespace

bool Inputs::has(TableKind kind) const { return first(kind) != nullptr; }

const plot::Table* Inputs::first(TableKind kind) const {
  const auto found = std::find_if(tables.begin(), tables.end(),
                                  [kind](const plot::Table& table) { return table.kind == kind; });
  return found == tables.end() ? nullptr : &*found;
}

bool Inputs::damaged() const {
  return std::any_of(files.begin(), files.end(),
                     [](const ReadFile& file) { return !file.damage.empty(); });
}

std::vector<ObserverRun> Inputs::runs() const {
  std::vector<ObserverRun> runs;
  for (const plot::Table& table : tables) {
    if (table.kind != TableKind::states || !is_estimate(table)) continue;
    runs.push_back({table.label, &table, nullptr});
  }
  const auto reports_of_observers =
      std::count_if(reports.begin(), reports.end(),
                    [](const JsonFile& json) { return json.program == "observer"; });
  for (const JsonFile& json : reports) {
    if (json.program != "observer") continue;
    const auto of_label = std::find_if(runs.begin(), runs.end(), [&](const ObserverRun& run) {
      return run.figures == nullptr && run.label == json.label;
    });
    if (of_label != runs.end()) {
      of_label->figures = &json.content;
    } else if (reports_of_observers == 1 && runs.size() == 1) {
      runs.front().figures = &json.content;
    } else {
      runs.push_back({json.label, nullptr, &json.content});
    }
  }
  return runs;
}

Inputs read_inputs(const std::vector<std::string>& texts, const CommonOptions& common) {
  Inputs inputs;
  inputs.scene = read_one_scene(texts, common, inputs.files);
  std::vector<std::string> of_tables;
  for (const std::string& text : texts) {
    const std::filesystem::path file = plot::file_of(text);
    if (is_scene(file)) continue;
    try {
      if (is_json(file)) {
        inputs.reports.push_back(read_json(text, file));
        inputs.files.push_back({file.string(), "report of " + inputs.reports.back().program, {}});
        continue;
      }
      inputs.tables.push_back(plot::read_table(text));
      of_tables.push_back(text);
      inputs.files.push_back(listed(file, inputs.tables.back()));
    } catch (const InputError& e) {
      const std::string what = e.what();
      const bool complete = what.find("expected") != std::string::npos;
      throw InputError(complete ? what : what + "; " + allowed);
    }
  }
  if (inputs.files.size() < 2) {
    throw UsageError(std::string("no file of a run is given beside the scene; ") + allowed);
  }
  put_labels(of_tables, inputs.tables);
  const auto predictions = std::stable_partition(
      inputs.tables.begin(), inputs.tables.end(),
      [](const plot::Table& table) { return table.kind != TableKind::predictions; });
  std::move(predictions, inputs.tables.end(), std::back_inserter(inputs.predictions));
  inputs.tables.erase(predictions, inputs.tables.end());
  // Curves of machines are thick, so that those of estimates are drawn over them.
  std::stable_partition(inputs.tables.begin(), inputs.tables.end(), [](const plot::Table& table) {
    return table.kind == TableKind::states && !is_estimate(table);
  });
  return inputs;
}

}  // namespace sprag::report
