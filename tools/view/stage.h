// What the thread that hears messages and the one that serves the page share.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>

#include "tools/view/watch.h"

namespace sprag::view {

struct Stage {
  explicit Stage(const Scene& scene, Freshness freshness) : watch(scene, freshness) {}

  std::mutex mutex;
  Watch watch;                       ///< by whoever has the mutex
  std::atomic<std::int64_t> now{0};  ///< the time of its messages, monotonic [ns]
  std::atomic<bool> over{false};     ///< a replay has come to its end
};

}  // namespace sprag::view
