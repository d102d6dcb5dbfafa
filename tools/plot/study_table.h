// Reads the rows of a study as columns of numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/csv.h"

namespace sprag::plot {

struct StudyTable {
  std::string name;               ///< of the study, from its manifest; else the file's folder
  std::vector<std::string> axes;  ///< keys that vary, from the manifest; one of each group
  std::vector<std::string> names;
  std::vector<std::vector<double>>
      columns;  ///< of equal length; NaN for cells that are not numbers
  /// Damage of the last file, after which nothing is used.
  std::optional<FileProblem> damage;

  const std::vector<double>* column(std::string_view name) const;
  std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
};

/// Whether the file has the header of a study: index,point,run.
bool is_study(const std::filesystem::path& file);

/// File name of the manifest of rows, whether it exists or not: rows.csv has manifest.json, others
/// their own name with .json.
std::filesystem::path manifest_of(const std::filesystem::path& rows);

/// Reads the shards of one study, or its single file. The keys that vary are read from the
/// manifests, if these are in the same folder. Throws InputError if headers differ, a file does not
/// exist, or a manifest is invalid.
StudyTable read_study_table(const std::vector<std::filesystem::path>& files);

}  // namespace sprag::plot
