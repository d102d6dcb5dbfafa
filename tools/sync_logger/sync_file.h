// Sync CSV `k,t,V,V1,...,Vf`: the error energy (23) and its parts (24) at the estimate's ticks,
// 17 significant digits.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

#include "sprag/detail/files/csv_writer.h"
#include "tools/sync_logger/logger.h"

namespace sprag {

class SyncWriter : public CsvWriter {
 public:
  /// Creates or empties `file`, or uses standard output if it is empty, and writes the header for
  /// f = `coordinates`. Errors are reported by good().
  SyncWriter(const std::filesystem::path& file, Eigen::Index coordinates);

  /// Appends a row. Errors are reported by good().
  void write(const SyncRow& row) noexcept;
};

}  // namespace sprag
