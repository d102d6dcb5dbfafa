// What the writers of CSV files have in common: a row that keeps its room, and failures, which are
// remembered until somebody asks.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "sprag/detail/files/output_file.h"

namespace sprag {

class CsvWriter {
 public:
  bool flush() noexcept { return file_.flush(); }
  bool close() noexcept { return file_.close(); }
  bool good() const noexcept { return file_.good(); }
  std::string error() const { return file_.error(); }

  /// Throw std::runtime_error with error() where something went wrong, until now or in closing.
  void require_good() const {
    if (!good()) throw std::runtime_error(error());
  }
  void finish() {
    close();
    require_good();
  }

 protected:
  /// Writes the header line; rows have usually at most `room` bytes.
  CsvWriter(OutputFile file, std::string_view header, std::size_t room) : file_(std::move(file)) {
    row_.reserve(room);
    file_.write(header);
    file_.write("\n");
  }
  CsvWriter(CsvWriter&&) = default;
  ~CsvWriter() = default;

  OutputFile file_;
  std::string row_;
};

/// A writer of the file, if there is to be one: none where the name is empty. Throws
/// std::runtime_error where it cannot be written.
template <typename Writer>
std::optional<Writer> writer_of(const std::filesystem::path& file) {
  std::optional<Writer> writer;
  if (file.empty()) return writer;
  writer.emplace(file);
  writer->require_good();
  return writer;
}

}  // namespace sprag
