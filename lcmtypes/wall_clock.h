// The host's wall clock, as used in messages.
#pragma once

#include <cstdint>
#include <ctime>

namespace sprag {

/// Time since 1970 [us].
inline std::int64_t wall_clock_us() {
  timespec time;
  clock_gettime(CLOCK_REALTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000 + time.tv_nsec / 1000;
}

}  // namespace sprag
