// Adapts an estimator of the kind `adaptive` to its machine. It collects a window of settled events
// until there are enough, requests their identification (task.h), and restarts the estimator's
// filter from the posterior. A window excludes events that are known to precede a change of the
// machine. Only settled ticks move it, so settled ticks depend on the events alone.
#pragma once

#include <cstdint>
#include <span>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/identification/task.h"

namespace sprag {

class MachineAdaptation {
 public:
  /// The estimator must identify parameters, and must outlive this.
  explicit MachineAdaptation(TrackingEstimator& estimator);

  /// Clears the window. Every event after `begins` [s] will be given; `closed`: contacts closed
  /// then.
  void start(double begins, ContactSet closed);

  /// Takes the events of a settled tick, and the state after them. Returns true if an
  /// identification of task() is requested: finish() must follow before the next tick. Does not
  /// allocate.
  bool settle(std::span<const ContactEvent> events, const TrackingState& state);
  const AdaptationTask& task() const { return task_; }
  /// Takes the result of task(): restarts the filter of `state`, which is that of the last
  /// settle(), or waits for more events. Does not allocate.
  void finish(const AdaptationResult& result, TrackingState& state);
  /// Identifies task() at once, and takes the result. Allocates. Throws Interrupted (interrupt.h).
  void identify(TrackingState& state);

  /// Largest number of events in a task.
  static constexpr std::size_t most_events = 1024;

 private:
  void drop(std::size_t events);

  TrackingEstimator& estimator_;
  AdaptationTask task_;       // the window
  std::size_t first_size_;    // number of events that the first identification of a window requires
  std::size_t size_ = 0;      // the same, of the next identification
  std::int64_t changed_ = 0;  // TrackingState::changed at the last settled tick
};

}  // namespace sprag
