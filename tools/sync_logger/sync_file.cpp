#include "tools/sync_logger/sync_file.h"

#include "sprag/files/csv.h"

namespace sprag {

SyncWriter::SyncWriter(const std::filesystem::path& file, Eigen::Index coordinates)
    : file_(file.empty() ? OutputFile::standard_output() : OutputFile(file)) {
  std::string header = "k,t,V";
  for (Eigen::Index i = 1; i <= coordinates; ++i) {
    header += ",V";
    append_number(header, std::int64_t{i});
  }
  text_.reserve(static_cast<std::size_t>(coordinates + 3) * 26);
  file_.write(header);
  file_.write("\n");
}

void SyncWriter::write(const SyncRow& row) noexcept {
  text_.clear();
  append_number(text_, row.k);
  text_ += ',';
  append_number(text_, row.t);
  for (const double energy : row.energy) {
    text_ += ',';
    append_number(text_, energy);
  }
  text_ += '\n';
  file_.write(text_);
}

}  // namespace sprag
