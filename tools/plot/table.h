// Reads a CSV written by one of the programs as columns of numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/csv.h"

namespace sprag::plot {

enum class TableKind { states, events, energy, impacts };

struct Table {
  std::string label;  ///< name of its curves
  TableKind kind = TableKind::states;
  std::vector<std::string> names;
  std::vector<std::vector<double>>
      columns;                        ///< of equal length; NaN for cells that are not numbers
  std::optional<FileProblem> damage;  ///< damage after which nothing is used

  /// The column of this name; null if there is none.
  const std::vector<double>* column(std::string_view name) const;
};

/// Reads `[LABEL=]FILE`; the default label is the file's name without extension. Throws InputError
/// if the file does not exist or its header is not that of a TableKind.
Table read_table(const std::string& text);

/// FILE of `[LABEL=]FILE`; the name of a scene in scenes_folder() is replaced by its file.
std::filesystem::path file_of(const std::string& text);

}  // namespace sprag::plot
