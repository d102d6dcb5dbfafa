// LCM log files, as lcm-logger writes them: big-endian records of sync word 0xEDA1DA01, int64 event
// number, int64 time stamp [us], int32 channel length, int32 data length, channel, data; no
// checksum.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mechanics/output_file.h"

namespace sprag {

struct ChannelRecord {
  std::int64_t number = 0;  ///< event number
  std::int64_t utime = 0;   ///< wall clock at arrival [us]
  std::string channel;
  std::vector<std::uint8_t> data;
};

struct LogDamage {
  std::uint64_t offset;  ///< where the damaged record begins [bytes]
  std::string what;
};

/// Reads a log record by record, up to its end or the first damage. liblcm's reader does not tell
/// the two apart and loses the rest of the file to one bad length.
class ChannelLogReader {
 public:
  /// Throws InputError (mechanics/csv.h) if the file cannot be opened.
  explicit ChannelLogReader(const std::filesystem::path& file);

  /// Reads the next record. Returns false at the end of the log or at damage.
  bool next(ChannelRecord& record);

  /// Set once next() has met damage: everything before it has been delivered.
  const std::optional<LogDamage>& damage() const { return damage_; }

 private:
  /// Appends up to `count` bytes to `bytes`; false if there are fewer.
  template <class Bytes>
  bool read(Bytes& bytes, std::size_t count);
  bool stop(std::string what);

  std::ifstream stream_;
  std::uint64_t offset_ = 0;
  std::vector<std::uint8_t> head_;
  std::optional<LogDamage> damage_;
};

/// Writes a log that liblcm (lcm-logplayer) and ChannelLogReader read. Never throws while it
/// writes.
class ChannelLogWriter {
 public:
  /// Creates or empties the file; a failure shows in good().
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
