// Data shared by the thread that receives messages and the thread that serves the page.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>

#include "tools/view/watch.h"

namespace sprag::view {

struct Stage {
  explicit Stage(const Scene& scene, Freshness freshness) : watch(scene, freshness) {}

  std::mutex mutex;
  Watch watch;                       ///< guarded by `mutex`
  std::atomic<std::int64_t> now{0};  ///< time of the watch's messages, monotonic [ns]
  std::atomic<bool> over{false};     ///< set at the end of a replay, never cleared
};

}  // namespace sprag::view
