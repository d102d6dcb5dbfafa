// Arrival time of a message, by both clocks of the host.
#pragma once

#include <cstdint>
#include <limits>

namespace sprag {

struct Arrival {
  std::int64_t monotonic = 0;  ///< [ns], from an arbitrary origin
  std::int64_t wall = 0;       ///< [us]
  /// First message of a recording that was appended to others in one log.
  bool appended = false;
};

/// Wall time from the sending of a message to its arrival [us]; meaningful if the clocks of both
/// hosts agree. The smallest integer if the time of sending is out of range.
inline std::int64_t delay(std::int64_t utime, const Arrival& arrival) {
  constexpr std::int64_t far_future = std::int64_t{1} << 60;
  if (utime < 0 || utime > far_future) return std::numeric_limits<std::int64_t>::min();
  return arrival.wall - utime;
}

}  // namespace sprag
