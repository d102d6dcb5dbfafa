// The lines of a text file that is in memory, and errors at a position in the current line.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "sprag/scene_file.h"

namespace sprag {

/// The content of a file without a UTF-8 byte order mark. Throws InputError (input_file.h) for a
/// file that cannot be read, is larger than 1 GiB, or is not a regular file, since a pipe may be
/// endless.
std::string read_regular_text(const std::filesystem::path& file);

class TextLines {
 public:
  /// `file` is the name in messages; `text` must outlive this.
  TextLines(std::string file, std::string_view text) : file_(std::move(file)), rest_(text) {}

  /// Moves to the next line. Returns false at the end of the text.
  bool next();

  /// Moves to the next line that is neither empty nor a comment, which begins with one of these
  /// characters.
  bool next_data(std::string_view comments);

  std::string_view line() const { return line_; }
  /// Number of the current line, from 1.
  int number() const { return number_; }

  /// Throws SceneError at `at`, which must be part of the current line.
  [[noreturn]] void fail(std::string_view at, const std::string& message) const {
    throw SceneError(file_, number_, static_cast<int>(at.data() - line_.data()) + 1, message);
  }
  /// Throws SceneError at the begin of the current line.
  [[noreturn]] void fail(const std::string& message) const { fail_at(number_, message); }
  /// Throws SceneError at the begin of a line.
  [[noreturn]] void fail_at(int number, const std::string& message) const {
    throw SceneError(file_, number, 1, message);
  }
  /// Throws SceneError about the file as a whole.
  [[noreturn]] void fail_whole(const std::string& message) const {
    throw SceneError(file_, message);
  }

 private:
  std::string file_;
  std::string_view rest_, line_;
  int number_ = 0;
};

}  // namespace sprag
