// A buffered output file that never throws while it is written: the first failure is remembered,
// later writes are ignored, and whoever closes the file learns of it. What was written until then
// ends with a whole record, also on a full disk.
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
  /// Creates or empties `file`; a failure shows in good().
  explicit OutputFile(const std::filesystem::path& file);
  OutputFile(OutputFile&&) noexcept = default;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile() { flush(); }

  static OutputFile standard_output();

  /// Adds a record to the file: its bytes stay together. They are written when 64 KiB have
  /// gathered, or by flush().
  void write(std::string_view record) noexcept;

  /// Hands everything to the operating system. Returns good().
  bool flush() noexcept;

  /// Flushes and closes. Returns good(), which stays as it is from here on.
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

/// Writes a file of this text. Throws std::runtime_error, "FILE: No space left on device", where it
/// cannot be written as a whole.
void write_file(const std::filesystem::path& file, std::string_view text);

}  // namespace sprag
