// Waiting for another thread, without a lock, or for a time.
#pragma once

#include <semaphore.h>

#include <cstdint>
#include <ctime>

namespace sprag {

/// Waiting threads check their conditions at least at this interval, even without a signal [ns].
inline constexpr std::int64_t between_looks = 100'000'000;

class Wake {
 public:
  Wake() { sem_init(&semaphore_, 0, 0); }
  ~Wake() { sem_destroy(&semaphore_); }
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  void signal() { sem_post(&semaphore_); }

  /// Waits for signal() until a time of the monotonic clock [ns]; may return early. Consumes all
  /// pending signals, so the caller must check all conditions.
  void wait_until(std::int64_t deadline) {
    const timespec time{deadline / 1'000'000'000, deadline % 1'000'000'000};
    if (sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &time) != 0) return;
    while (sem_trywait(&semaphore_) == 0) {
    }
  }

 private:
  sem_t semaphore_;
};

inline std::int64_t monotonic_now() {
  timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

}  // namespace sprag
