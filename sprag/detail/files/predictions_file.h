// Predictions CSV: the events that are foreseen (prediction.h), one a row, 17 significant digits. A
// prediction of nothing is a row without an event: t, contact, kind and sigma_t are empty.
#pragma once

#include <filesystem>
#include <string>

#include "sprag/detail/files/csv_writer.h"
#include "sprag/prediction.h"

namespace sprag {

class PredictionsWriter : public CsvWriter {
 public:
  /// Creates or empties the file and writes the header; a failure shows in good().
  explicit PredictionsWriter(const std::filesystem::path& file);

  /// Appends its rows. Failures are remembered.
  void write(const Prediction& prediction) noexcept;
};

}  // namespace sprag
