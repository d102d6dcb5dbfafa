// A buffered output file whose writes never throw. The first error is kept, later writes are
// ignored, and good() and close() report it. Even on a full disk the file ends with a complete
// record.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

class OutputFile {
 public:
  /// Creates or empties `file`. Errors are reported by good().
  explicit OutputFile(const std::filesystem::path& file);
  OutputFile(OutputFile&&) noexcept = default;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile() { flush(); }

  static OutputFile standard_output();

  /// Appends a record, whose bytes stay together. Records are written when 64 KiB have accumulated,
  /// or by flush().
  void write(std::string_view record) noexcept;

  /// Passes all bytes to the operating system. Returns good().
  bool flush() noexcept;

  /// Flushes and closes. Returns good(), which does not change afterwards.
  bool close() noexcept;

  bool good() const noexcept { return error_ == 0; }

  /// "FILE: No space left on device"; empty while good().
  std::string error() const;

 private:
  struct Closer {
    void operator()(std::FILE* stream) const noexcept;
  };
  OutputFile(std::string name, std::FILE* stream);
  void cut_after(std::size_t written) noexcept;

  std::string name_;
  std::unique_ptr<std::FILE, Closer> stream_;
  std::string buffer_;
  std::vector<std::size_t> record_ends_;  // in buffer_
  std::size_t size_ = 0;                  // of the file [bytes]
  int error_ = 0;
};

/// Writes a file with this text. Throws Error, "FILE: No space left on device", if it
/// cannot be written completely.
void write_file(const std::filesystem::path& file, std::string_view text);

}  // namespace sprag
