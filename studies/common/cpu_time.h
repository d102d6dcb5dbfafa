// CPU time of this process.
#pragma once

#include <ctime>

namespace sprag::common {

/// CPU time of all threads since the start of the process [s].
inline double cpu_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace sprag::common
