// Impacts CSV: what an estimator says of each event (impact_record.h), one a row, 17 significant
// digits. `kind` is impact, closes or opens; the columns of forces are empty but for releases of
// contacts that were held.
#pragma once

#include <filesystem>
#include <string>

#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/files/csv_writer.h"

namespace sprag {

/// "impact", "closes" or "opens".
const char* name(ContactEventKind kind);

class ImpactsWriter : public CsvWriter {
 public:
  /// Creates or empties the file and writes the header; a failure shows in good().
  explicit ImpactsWriter(const std::filesystem::path& file);

  /// Appends a row. Failures are remembered.
  void write(const ImpactRecord& record) noexcept;
};

}  // namespace sprag
