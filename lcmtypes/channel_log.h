// LCM log files, in the format of lcm-logger: big-endian records of sync word 0xEDA1DA01, int64
// event number, int64 time stamp [us], int32 channel length, int32 data length, channel, data; no
// checksum.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/output_file.h"

namespace sprag {

struct ChannelRecord {
  std::int64_t number = 0;  ///< event number
  std::int64_t utime = 0;   ///< wall clock at arrival [us]
  std::string channel;
  std::vector<std::uint8_t> data;
  /// First record of a recording that was appended to others, as by cat or lcm-logger --append: its
  /// event number is not greater than the one before.
  bool appended = false;
};

/// A range of bytes of a log that contains no valid record.
struct LogDamage {
  std::uint64_t begin, end;  ///< half-open range [begin, end)
  bool to_the_end;           ///< no record follows
  std::string what;
};

/// Reads a log record by record and skips damaged parts. Reading resumes at the next complete
/// record that ends at another record or at the end of the file, since a sync word alone may be
/// part of a message. liblcm's reader loses the rest of the file after one wrong length, and does
/// not distinguish damage from the end.
class ChannelLogReader {
 public:
  /// Throws InputError (sprag/detail/files/input_file.h) if the file cannot be opened.
  explicit ChannelLogReader(const std::filesystem::path& file);
  explicit ChannelLogReader(InputFile file);

  /// Reads the next record. Returns false at the end of the log.
  bool next(ChannelRecord& record);

  /// The damaged parts that next() has skipped.
  const std::vector<LogDamage>& damages() const { return damages_; }

  /// Whether the file is empty; valid after next() has returned false.
  bool empty() const { return file_.offset() == 0; }

 private:
  struct Head;

  std::string_view from(std::size_t place, std::size_t count);
  std::string examine(std::size_t place, Head& head);
  bool is_followed(std::size_t place);
  bool leads_on(const Head& head);
  bool is_record(std::size_t place);
  std::size_t find_record(std::size_t size);
  void pass_over(std::string what);

  InputFile file_;
  std::optional<std::int64_t> last_number_;
  std::vector<LogDamage> damages_;
};

/// Writes a log that liblcm (lcm-logplayer) and ChannelLogReader can read. Never throws while
/// writing.
class ChannelLogWriter {
 public:
  /// Creates or empties the file. Errors are reported by good().
  explicit ChannelLogWriter(const std::filesystem::path& file);

  /// Appends a record; events are numbered from 0. Returns good().
  bool write(std::int64_t utime, std::string_view channel,
             std::span<const std::uint8_t> data) noexcept;

  bool flush() noexcept { return file_.flush(); }
  bool close() noexcept { return file_.close(); }
  bool good() const noexcept { return file_.good(); }
  std::string error() const { return file_.error(); }

 private:
  OutputFile file_;
  std::int64_t number_ = 0;
  std::string record_;
};

}  // namespace sprag
