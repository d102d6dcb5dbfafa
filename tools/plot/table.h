// Reads a CSV written by one of the programs as columns of numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/csv.h"

namespace sprag::plot {

enum class TableKind { states, events, energy, impacts, predictions };

/// Values of a column `kind`: impact, closes, opens.
inline constexpr double impact_kind = 3.0, closes_kind = 1.0, opens_kind = 2.0;

struct Table {
  std::string label;  ///< name of its curves
  TableKind kind = TableKind::states;
  std::vector<std::string> names;
  std::vector<std::vector<double>>
      columns;                        ///< of equal length; NaN for cells that are not numbers
  std::size_t left_out = 0;           ///< rows of events that are marked as spurious
  std::optional<FileProblem> damage;  ///< damage after which nothing is used

  /// The column of this name; null if there is none.
  const std::vector<double>* column(std::string_view name) const;
};

/// Reads `[LABEL=]FILE`; the default label is the file's name without extension. Throws InputError
/// if the file does not exist or its header is not that of a TableKind.
Table read_table(const std::string& text);

/// Whether states are those of an estimate. It has columns about its own error; the states of a
/// master do not.
bool is_estimate(const Table& states);

/// Name of a kind, as in messages: "states", "events", "V", "impacts" or "predictions".
const char* name(TableKind kind);

/// Label and FILE of `[LABEL=]FILE`. Without a label, the file's name without extension.
std::string label_of(const std::string& text);

/// FILE of `[LABEL=]FILE`; the name of a scene in scenes_folder() is replaced by its file.
std::filesystem::path file_of(const std::string& text);

}  // namespace sprag::plot
