// Runs the identification tasks of an adaptive estimator (sprag/detail/identification/task.h) in a
// thread of its own. The real-time loop hands over a task and polls for the result.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

#include "observer/wake.h"
#include "sprag/detail/identification/task.h"

namespace sprag {

class IdentificationThread {
 public:
  /// `family` must outlive this. A task has at most `most_events` events.
  IdentificationThread(const SceneValues& family, std::size_t most_events);
  IdentificationThread(const IdentificationThread&) = delete;
  IdentificationThread& operator=(const IdentificationThread&) = delete;

  /// Identifies until stop().
  void run();
  void stop();

  /// To be called by the loop; neither blocks nor allocates. False: another task is running.
  bool ask(const AdaptationTask& task);
  /// The result of the last task, returned once; null: none yet. It is valid until the next result.
  const AdaptationResult* result();

 private:
  enum class Stage { idle, asked, done };

  const SceneValues& family_;
  AdaptationTask task_;
  std::array<AdaptationResult, 2> results_;  // the result in use, and the next one
  std::size_t next_ = 0;
  std::atomic<Stage> stage_{Stage::idle};
  std::atomic<bool> stop_{false};
  Wake asked_;
};

}  // namespace sprag
