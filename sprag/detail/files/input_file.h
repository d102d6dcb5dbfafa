// An input file that is opened once and read once, from beginning to end. It may be a pipe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "sprag/error.h"

namespace sprag {

/// An input file cannot be opened or is not of the expected kind. what() reads "FILE: reason".
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

  /// The unread bytes: at least `count` unless the file has fewer, valid until the next call. Waits
  /// for a pipe. Throws Interrupted (interrupt.h) if a stop is requested.
  std::string_view ahead(std::size_t count);

  /// Marks `count` of the bytes that ahead() returned as read.
  void skip(std::size_t count);

  /// Number of bytes read.
  std::uint64_t offset() const { return offset_; }

  /// Whether a read error, and not the end of the file, ended the bytes of ahead().
  bool failed() const { return failed_; }

  const std::filesystem::path& path() const { return path_; }

 private:
  bool fill();

  std::filesystem::path path_;
  int descriptor_;
  std::string buffer_;
  std::size_t begin_ = 0;  // of the unread bytes in buffer_
  std::uint64_t offset_ = 0;
  bool ended_ = false;
  bool failed_ = false;
};

/// Upper limit of the size of a text file [bytes]. Larger ones would not fit into memory as
/// numbers.
inline constexpr std::size_t largest_text = std::size_t{1} << 30U;

/// The content of a file, which may be a pipe. Throws InputError if it cannot be opened or read, or
/// is larger than `most` bytes, as an endless device is.
std::string read_whole(const std::filesystem::path& file, std::size_t most = largest_text);

}  // namespace sprag
