#include "tools/sync_logger/sync_file.h"

#include "sprag/detail/files/csv.h"

namespace sprag {

namespace {

std::string sync_header(Eigen::Index coordinates) {
  std::string header = "k,t,V";
  for (Eigen::Index i = 1; i <= coordinates; ++i) {
    header += ",V";
    append_number(header, std::int64_t{i});
  }
  return header;
}

}  // namespace

SyncWriter::SyncWriter(const std::filesystem::path& file, Eigen::Index coordinates)
    : CsvWriter(file.empty() ? OutputFile::standard_output() : OutputFile(file),
                sync_header(coordinates), static_cast<std::size_t>(coordinates + 3) * 26) {}

void SyncWriter::write(const SyncRow& row) noexcept {
  add(row.k);
  add(row.t);
  for (const double energy : row.energy) add(energy);
  end_row();
}

}  // namespace sprag
