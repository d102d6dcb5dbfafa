// Runs independent tasks on several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {

/// Threads that the machine runs at a time.
inline int cores() { return static_cast<int>(std::max(1U, std::thread::hardware_concurrency())); }

/// Calls work(i) for i = 0, ..., count - 1 on `threads` threads, or on fewer if the system has no
/// more. After the first exception no further tasks start; the last exception is thrown when all
/// threads have ended.
template <typename Work>
void in_parallel(int threads, int count, const Work& work) {
  std::atomic<int> next = 0;
  std::exception_ptr failure;
  std::mutex mutex;
  const auto take = with_stop_token([&] {
    try {
      for (int i = next++; i < count; i = next++) work(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      next = count;
    }
  });
  std::vector<std::thread> others;
  try {
    for (int i = 1; i < std::min(threads, count); ++i) others.emplace_back(take);
  } catch (const std::system_error&) {
  }
  take();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace sprag
