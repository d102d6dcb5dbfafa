// Common base of the writers of CSV files: a row buffer that is reused, and errors, which are kept
// until they are queried.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/error.h"

namespace sprag {

class CsvWriter {
 public:
  bool flush() noexcept { return file_.flush(); }
  bool close() noexcept { return file_.close(); }
  bool good() const noexcept { return file_.good(); }
  std::string error() const { return file_.error(); }

  /// Throw Error with error() if a write has failed; finish() closes the file first.
  void require_good() const {
    if (!good()) throw Error(error());
  }
  void finish() {
    close();
    require_good();
  }

 protected:
  /// Writes the header line. `room`: usual largest number of bytes of a row.
  CsvWriter(OutputFile file, std::string_view header, std::size_t room) : file_(std::move(file)) {
    row_.reserve(room);
    file_.write(header);
    file_.write("\n");
  }
  CsvWriter(CsvWriter&&) = default;
  ~CsvWriter() = default;

  /// Appends a field to the row.
  void add(double number) {
    append_number(row_, number);
    row_ += ',';
  }
  void add(std::int64_t number) {
    append_number(row_, number);
    row_ += ',';
  }
  void add(std::string_view word) { (row_ += word) += ','; }
  /// Writes the row, which has a field at least.
  void end_row() {
    row_.back() = '\n';
    file_.write(row_);
    row_.clear();
  }

 private:
  OutputFile file_;
  std::string row_;
};

/// A writer of the file, or nullopt if the name is empty. Throws Error if the file
/// cannot be written.
template <typename Writer>
std::optional<Writer> writer_of(const std::filesystem::path& file) {
  std::optional<Writer> writer;
  if (file.empty()) return writer;
  writer.emplace(file);
  writer->require_good();
  return writer;
}

}  // namespace sprag
