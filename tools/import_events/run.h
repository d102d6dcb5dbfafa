// import_events: reads the file, says what is wrong with it, writes events.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "tools/import_events/choice.h"
#include "tools/import_events/import.h"
#include "tools/import_events/levels.h"

namespace sprag {

struct ImportRun {
  std::filesystem::path file;
  std::optional<char> separator;   ///< none: recognized
  std::vector<std::string> names;  ///< of the columns of a file without a header; else empty
  std::vector<ColumnOption> columns;
  LevelOptions levels;
  std::optional<Decimal> unit;   ///< seconds; none: as the columns' names say, else 1
  ImportOptions import;          ///< its unit is found in the file
  std::filesystem::path output;  ///< .csv or .lcmlog; empty: CSV to standard output
};

/// Imports for a machine with `contacts` contacts, fills `report` and returns the exit code. Bad
/// rows go to stderr, at most 20 of them. Throws UsageError or InputError for bad options or a file
/// that cannot be read; std::runtime_error if no event is left, and then nothing is written, or if
/// the output cannot be written.
int run_import(const ImportRun& run, int contacts, const CommonOptions& common,
               nlohmann::ordered_json& report);

}  // namespace sprag
