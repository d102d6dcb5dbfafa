// Recordings of a master: events CSVs, and LCM logs with the log's own clock.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>

#include "lcmtypes/channel_log.h"
#include "observer/arrival.h"

namespace sprag {

/// By its first bytes, or by its name where it is empty or damaged from the start.
inline bool is_lcm_log(const std::filesystem::path& file) {
  constexpr std::array<char, 4> sync{'\xED', '\xA1', '\xDA', '\x01'};
  std::array<char, 4> first{};
  std::ifstream(file, std::ios::binary).read(first.data(), first.size());
  return first == sync || file.extension() == ".lcmlog";
}

/// The log's own clock, which advances a little with every record: not every log's does.
class LogClock {
 public:
  Arrival arrival(const ChannelRecord& record) {
    constexpr std::int64_t latest = std::numeric_limits<std::int64_t>::max() / 4000;
    const std::int64_t utime = std::clamp<std::int64_t>(record.utime, 0, latest);
    now_ = std::max(1000 * utime, now_ + least_step);
    return {now_, utime};
  }

 private:
  static constexpr std::int64_t least_step = 1'000'000;  // ns
  std::int64_t now_ = 0;
};

}  // namespace sprag
