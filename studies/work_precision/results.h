// The rows of the comparison as files: a CSV that grows row by row, and JSON with the same rows,
// the machine of the measurements and the abilities of each method.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sprag/detail/files/output_file.h"
#include "studies/work_precision/measure.h"

namespace sprag::work_precision {

/// "ours", "rival" or "peer".
const char* name(Kind kind);

class Results {
 public:
  /// Starts work_precision.csv and .json in `directory`, which must exist. Throws
  /// std::runtime_error if they cannot be written, as add() does.
  explicit Results(const std::filesystem::path& directory);

  /// Adds a row; both files are complete when it returns. Unknown figures are empty fields in the
  /// CSV and null in JSON.
  void add(const std::string& scene, const Method& method, double setting,
           const Measurement& measurement);

  std::size_t rows() const { return json_["rows"].size(); }

 private:
  void write_json() const;

  std::filesystem::path json_file_;
  OutputFile csv_;
  nlohmann::ordered_json json_;
};

}  // namespace sprag::work_precision
