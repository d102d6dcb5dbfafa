// The files of rows of a study. During the study rows are appended as they arrive; at the end they
// are sorted by index. After a crash the file is read again and truncated after its last complete
// run.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/study/schedule.h"

namespace sprag::study {

/// Format of the rows of a study.
struct Layout {
  std::string header;       ///< without end of line
  std::size_t fields = 0;   ///< number of fields of a line
  std::size_t n_field = 0;  ///< position of the field n, from 0; 0: each run is one row
  std::int64_t n_last = 1;  ///< n of the last row of a run
};

/// Complete runs with consecutive indices in a file.
struct Segment {
  Range range;
  std::uint64_t begin = 0, end = 0;  ///< bytes
};

struct Contents {
  std::vector<Segment> segments;  ///< in the order of the file
  std::uint64_t end = 0;          ///< of the last complete run [bytes]; 0: not even a header
  std::int64_t failures = 0;

  std::vector<Range> ranges() const;
};

/// Reads a file of rows, whose last run may be incomplete. Throws InputError if it cannot be read,
/// has another format, has an index outside `all`, or has an index twice.
Contents read_rows(const std::filesystem::path& file, const Layout& layout, Range all);

/// A file for appending rows, locked against other processes.
class RowFile {
 public:
  /// Opens or creates the file. Throws UsageError if another process has it open, or
  /// std::runtime_error.
  explicit RowFile(std::filesystem::path file);
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;
  ~RowFile();

  /// Truncates the file after `contents` and writes the header if there is none. Throws
  /// std::runtime_error.
  void go_on(const Contents& contents, const Layout& layout);

  /// Appends the rows of a chunk completely, or, for example on a full disk, not at all, and then
  /// throws std::runtime_error. Synchronizes the file with the disk from time to time.
  void append(const Chunk& chunk);

  /// Synchronizes the file with the disk and closes it. Throws std::runtime_error.
  void close();

 private:
  void write(const std::string& text);
  [[noreturn]] void fail() const;

  std::filesystem::path file_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  std::chrono::steady_clock::time_point synced_;
};

/// A file and its complete runs.
struct RowSource {
  std::filesystem::path file;
  Contents contents;
  bool own = false;  ///< the file may be renamed to the merged file
};

/// Merges the rows of all sources, which have no common index, in order of index into `file`. The
/// file appears when it is complete. Throws std::runtime_error, or Interrupted.
void merge_rows(const std::vector<RowSource>& sources, const Layout& layout,
                const std::filesystem::path& file);

}  // namespace sprag::study
