// Predictions CSV: one row per predicted event (prediction.h), 17 significant digits. A prediction
// without events has one row with empty t, contact, kind and sigma_t.
#pragma once

#include <filesystem>
#include <string>

#include "sprag/detail/estimates/predictor.h"
#include "sprag/detail/files/csv_writer.h"

namespace sprag {

class PredictionsWriter : public CsvWriter {
 public:
  /// Creates or empties the file and writes the header. Errors are reported by good().
  explicit PredictionsWriter(const std::filesystem::path& file);

  /// Appends the rows of a prediction. Errors are reported by good().
  void write(const Prediction& prediction) noexcept;
};

}  // namespace sprag
