// An input file that is opened once and read once, from its beginning to its end, so that a pipe
// does as well.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "sprag/error.h"

namespace sprag {

/// An input file that cannot be opened or is of another kind. what() reads "FILE: reason".
struct InputError : Error {
  using Error::Error;
};

class InputFile {
 public:
  /// Throws InputError if the file cannot be opened or is a directory.
  explicit InputFile(std::filesystem::path file);
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  ~InputFile();

  /// What comes next: at least `count` bytes unless the file has no more, valid until the next
  /// call. Waits for a pipe; throws Interrupted (interrupt.h) if a stop is requested.
  std::string_view ahead(std::size_t count);

  /// Leaves behind `count` of the bytes that ahead() has shown.
  void skip(std::size_t count);

  /// Bytes left behind.
  std::uint64_t offset() const { return offset_; }

  /// Whether what ahead() has shown ends where it does because the file could not be read.
  bool failed() const { return failed_; }

  const std::filesystem::path& path() const { return path_; }

 private:
  bool fill();

  std::filesystem::path path_;
  int descriptor_;
  std::string buffer_;
  std::size_t begin_ = 0;  // of what is ahead, in buffer_
  std::uint64_t offset_ = 0;
  bool ended_ = false;
  bool failed_ = false;
};

/// More than any text that fits into memory as numbers needs [bytes].
inline constexpr std::size_t largest_text = std::size_t{1} << 30U;

/// All of a file, which may be a pipe. Throws InputError if it cannot be opened or read, or is
/// larger than `most` bytes (a device without an end is).
std::string read_whole(const std::filesystem::path& file, std::size_t most = largest_text);

}  // namespace sprag
