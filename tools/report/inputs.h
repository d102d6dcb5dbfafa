// Reads the files of a report and recognizes them by their content: the scene, CSV files as plot
// does, and JSON of --report or of identify --json.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "sprag/scene.h"
#include "tools/plot/table.h"
#include "tools/report/json_value.h"

namespace sprag::report {

struct JsonFile {
  std::string label, file;
  std::string program;  ///< that wrote it: observer, identify, ...
  Json content;         ///< an object
};

/// A line of the list of files.
struct ReadFile {
  std::string name, content, damage;
};

/// A run of the observer: its states, its JSON report or both.
struct ObserverRun {
  std::string label;
  const plot::Table* states = nullptr;
  const Json* figures = nullptr;
};

struct Inputs {
  Scene scene;
  std::vector<plot::Table> tables;  ///< without predictions
  std::vector<plot::Table> predictions;
  std::vector<JsonFile> reports;
  std::vector<ReadFile> files;

  bool has(plot::TableKind kind) const;
  /// The first table of a kind; null if there is none.
  const plot::Table* first(plot::TableKind kind) const;
  bool damaged() const;
  /// Runs in the order of the files. They point into this object.
  std::vector<ObserverRun> runs() const;
};

/// Reads [LABEL=]FILE in any order, exactly one of them a scene. Files without a label are labelled
/// "machine" and "estimate", by their content, unless there are several estimates. Throws
/// UsageError, InputError and SceneError, with the file's name and the allowed kinds.
Inputs read_inputs(const std::vector<std::string>& texts, const CommonOptions& common);

}  // namespace sprag::report
