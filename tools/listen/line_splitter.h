// Cuts a stream of bytes into lines. A line may arrive in any number of pieces. It ends with LF,
// CRLF or CR. Knows neither a device nor a clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace sprag {

class LineSplitter {
 public:
  /// Longer lines are given up: `take` calls `too_long` once, and the rest of the line is skipped.
  static constexpr std::size_t longest = 4096;

  /// Calls line(text) for each line that `bytes` completes, empty ones omitted, and too_long(begin)
  /// with the first bytes of a line that is too long, which is then not complete. The text is valid
  /// during the call.
  template <class Line, class TooLong>
  void take(std::string_view bytes, Line line, TooLong too_long) {
    while (!bytes.empty()) {
      const std::size_t end = bytes.find_first_of("\r\n");
      const bool complete = end != std::string_view::npos;
      const std::string_view piece = bytes.substr(0, end);
      const bool second_half = complete && end == 0 && bytes[0] == '\n' && after_return_;
      after_return_ = complete && bytes[end] == '\r';
      bytes.remove_prefix(complete ? end + 1 : bytes.size());
      if (second_half) continue;
      if (complete) ++number_;
      if (skipping_) {
        skipping_ = !complete;
        continue;
      }
      if (begun_.size() + piece.size() > longest) {
        begun_.append(piece.substr(0, longest - begun_.size()));
        too_long(std::string_view(begun_));
        begun_.clear();
        skipping_ = !complete;
        continue;
      }
      if (!complete) {
        begun_ += piece;
      } else if (begun_.empty()) {
        if (!piece.empty()) line(piece);
      } else {
        begun_ += piece;
        line(std::string_view(begun_));
        begun_.clear();
      }
    }
  }

  /// Number of the last complete line, from 1; empty ones count.
  std::int64_t number() const { return number_; }

  /// The begin of a line that is not complete yet.
  std::string_view begun() const { return begun_; }

  /// Forgets the begin of a line.
  void clear() {
    begun_.clear();
    skipping_ = false;
  }

  /// Skips the rest of the line that is under way.
  void skip_line() {
    begun_.clear();
    skipping_ = true;
  }

 private:
  std::string begun_;
  bool skipping_ = false;
  bool after_return_ = false;  // the last byte was CR
  std::int64_t number_ = 0;
};

}  // namespace sprag
