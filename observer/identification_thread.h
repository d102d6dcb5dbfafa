// Identifies in a thread of its own what an adaptive estimator wants
// (detail/identification/task.h), so that the real-time loop never does: it hands over a task and
// looks now and then for the result.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

#include "observer/wake.h"
#include "sprag/detail/identification/task.h"

namespace sprag {

class IdentificationThread {
 public:
  /// `family` must outlive this; a task has up to `most_events`.
  IdentificationThread(const MachineFamily& family, std::size_t most_events);
  IdentificationThread(const IdentificationThread&) = delete;
  IdentificationThread& operator=(const IdentificationThread&) = delete;

  /// Identifies until stop().
  void run();
  void stop();

  /// Of the loop; neither blocks nor allocates. False: another task is under way.
  bool ask(const AdaptationTask& task);
  /// What has become of the last task, once; null: nothing yet. It stays until the next one.
  const AdaptationResult* result();

 private:
  enum class Stage { idle, asked, done };

  const MachineFamily& family_;
  AdaptationTask task_;
  std::array<AdaptationResult, 2> results_;  // the one that is in use, and the next
  std::size_t next_ = 0;
  std::atomic<Stage> stage_{Stage::idle};
  std::atomic<bool> stop_{false};
  Wake asked_;
};

}  // namespace sprag
