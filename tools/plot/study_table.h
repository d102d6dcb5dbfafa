// The rows of a study, as columns of numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/csv.h"

namespace sprag::plot {

struct StudyTable {
  std::string name;               ///< of the study, of its manifest; else the file's folder
  std::vector<std::string> axes;  ///< what varies, of the manifest, one of each group
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< of one length; what is no number is NaN
  /// Where reading stopped, of the last file: nothing after it is used.
  std::optional<FileProblem> damage;

  const std::vector<double>* column(std::string_view name) const;
  std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
};

/// Whether the file's header is a study's: index,point,run.
bool is_study(const std::filesystem::path& file);

/// The manifest that belongs to rows, there or not: rows.csv has manifest.json, others their own
/// name with .json.
std::filesystem::path manifest_of(const std::filesystem::path& rows);

/// Reads shards of one study, or its one file; what varies comes from their manifests, where
/// these lie beside. Throws InputError: headers that differ, no such file, a
/// manifest that is none.
StudyTable read_study_table(const std::vector<std::filesystem::path>& files);

}  // namespace sprag::plot
