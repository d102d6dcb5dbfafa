// A CSV that one of the programs wrote, as columns of numbers.
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
  std::string label;  ///< what curves from it are called
  TableKind kind = TableKind::states;
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< of one length; what is no number is NaN
  std::optional<FileProblem> damage;         ///< where reading stopped: nothing after it is used

  /// The column of this name; null if there is none.
  const std::vector<double>* column(std::string_view name) const;
};

/// Reads `[LABEL=]FILE`; without a label it is the file's name without its extension. Throws
/// InputError: no such file, or a header that is none of a TableKind's.
Table read_table(const std::string& text);

/// FILE of `[LABEL=]FILE`; of a name in scenes_folder(), its file.
std::filesystem::path file_of(const std::string& text);

}  // namespace sprag::plot
