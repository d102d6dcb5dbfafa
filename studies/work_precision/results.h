// The rows of the comparison as a CSV that grows row by row.
#pragma once

#include <filesystem>
#include <string>

#include "sprag/detail/files/output_file.h"
#include "studies/work_precision/measure.h"

namespace sprag::work_precision {

class Results {
 public:
  /// Starts work_precision.csv in `directory`, which must exist. Throws std::runtime_error if it
  /// cannot be written, as add() does.
  explicit Results(const std::filesystem::path& directory);

  /// Adds a row; the file is complete when it returns. Parameter figures are empty fields.
  void add(const std::string& scene, const Method& method, double setting,
           const Measurement& measurement);

  std::size_t rows() const { return rows_; }

 private:
  OutputFile csv_;
  std::size_t rows_ = 0;
};

}  // namespace sprag::work_precision
