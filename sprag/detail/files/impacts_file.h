// Impacts CSV: one row per event as an estimator describes it (impact_record.h), 17 significant
// digits. `kind` is impact, closes or opens. The force columns are filled only for the release of a
// sustained contact.
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
  /// Creates or empties the file and writes the header. Errors are reported by good().
  explicit ImpactsWriter(const std::filesystem::path& file);

  /// Appends a row. Errors are reported by good().
  void write(const ImpactRecord& record) noexcept;
};

}  // namespace sprag
