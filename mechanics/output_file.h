// A buffered output file that never throws while it is written: the first failure is remembered,
// later writes are ignored, and whoever closes the file learns of it.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace sprag {

class OutputFile {
 public:
  /// Creates or empties `file`; a failure shows in good().
  explicit OutputFile(const std::filesystem::path& file);
  OutputFile(OutputFile&&) noexcept = default;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile() { flush(); }

  static OutputFile standard_output();

  /// Adds bytes to the file. They are written when 64 KiB have gathered, or by flush().
  void write(std::string_view bytes) noexcept;

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

  std::string name_;
  std::unique_ptr<std::FILE, Closer> stream_;
  std::string buffer_;
  int error_ = 0;
};

}  // namespace sprag
