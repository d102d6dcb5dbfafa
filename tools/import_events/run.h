// import_events: reads the file, reports its problems, writes events.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "sprag/detail/import/import.h"
#include "sprag/detail/import/levels.h"
#include "tools/import_events/choice.h"

namespace sprag {

struct ImportRun {
  std::filesystem::path file;
  std::optional<char> separator;   ///< none: detected
  std::vector<std::string> names;  ///< column names of a file without a header; else empty
  std::vector<ColumnOption> columns;
  LevelOptions levels;
  std::optional<Decimal> unit;   ///< seconds; none: from the columns' names, else 1
  ImportOptions import;          ///< its unit is determined by run_import()
  std::filesystem::path output;  ///< .csv or .lcmlog; empty: CSV to standard output
};

/// Imports for a machine with `contacts` contacts, fills `report` and returns the exit code. Bad
/// rows are listed on stderr, at most 20 of them. Throws UsageError or InputError for bad options
/// or a file that cannot be read. Throws std::runtime_error if no event is left, without writing
/// anything, or if the output cannot be written.
int run_import(const ImportRun& run, int contacts, const CommonOptions& common,
               nlohmann::ordered_json& report);

}  // namespace sprag
