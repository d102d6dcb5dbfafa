// The files of rows of a study. While it runs rows are appended as they come; in the end they are
// put in order of their indices. A file of a study that was killed is read again, and cut behind
// its last whole run.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/study/schedule.h"

namespace sprag::study {

/// What the rows of a study look like.
struct Layout {
  std::string header;       ///< without end of line
  std::size_t fields = 0;   ///< of a line
  std::size_t n_field = 0;  ///< number of the field n, from 0; 0: each run is one row
  std::int64_t n_last = 1;  ///< n of the last row of a run
};

/// Whole runs in a file that follow each other in order of their indices.
struct Segment {
  Range range;
  std::uint64_t begin = 0, end = 0;  ///< bytes
};

struct Contents {
  std::vector<Segment> segments;  ///< in the order of the file
  std::uint64_t end = 0;          ///< of the last whole run [bytes]; 0: there is not even a header
  std::int64_t failures = 0;

  std::vector<Range> ranges() const;
};

/// Reads a file of rows whose end may be missing. Throws InputError if it cannot be read, is no
/// such file, has indices that are not in `all`, or has one twice.
Contents read_rows(const std::filesystem::path& file, const Layout& layout, Range all);

/// A file that rows are appended to; others that open it meanwhile are refused.
class RowFile {
 public:
  /// Opens or creates it. Throws UsageError if another process has it open, or std::runtime_error.
  explicit RowFile(std::filesystem::path file);
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;
  ~RowFile();

  /// Cuts it behind `contents` and writes the header where there is none. Throws
  /// std::runtime_error.
  void go_on(const Contents& contents, const Layout& layout);

  /// Appends the rows of a chunk: all of them or, as on a full disk, none, which throws
  /// std::runtime_error. Now and then the system is told to put them on the disk.
  void append(const Chunk& chunk);

  /// Puts everything on the disk and closes. Throws std::runtime_error.
  void close();

 private:
  void write(const std::string& text);
  [[noreturn]] void fail() const;

  std::filesystem::path file_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  std::chrono::steady_clock::time_point synced_;
};

/// A file with its whole runs.
struct RowSource {
  std::filesystem::path file;
  Contents contents;
  bool own = false;  ///< it may become the merged file
};

/// Puts the rows of all sources, which have no index in common, in order into `file`, which appears
/// once it is complete. Throws std::runtime_error, or Interrupted.
void merge_rows(const std::vector<RowSource>& sources, const Layout& layout,
                const std::filesystem::path& file);

}  // namespace sprag::study
