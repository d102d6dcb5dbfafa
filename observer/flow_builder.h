// Builds flows (flows.h) in a thread of its own, so that the real-time loop never does: a flow
// takes milliseconds for a machine with many modes, and memory. What the loop asks for comes first;
// it waits meanwhile, and its ticks are late. Else the builder goes ahead by itself: single
// contacts, then the sets next to the last one that was asked for, up to a bounded amount of
// memory.
#pragma once

#include <atomic>
#include <cstdint>

#include "observer/wake.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag {

class FlowBuilder {
 public:
  /// From now on flows are built by run() alone, which another thread calls. `flows` must outlive
  /// this, and this every use of `flows`.
  explicit FlowBuilder(Flows& flows);
  FlowBuilder(const FlowBuilder&) = delete;
  FlowBuilder& operator=(const FlowBuilder&) = delete;

  /// Builds until stop().
  void run();

  /// Ends run(). Who waits for a flow, or asks for one from then on that is not there, gets an
  /// exception Interrupted.
  void stop();

  /// How often the loop had to wait for a flow.
  std::int64_t awaited() const { return awaited_; }

 private:
  void await(ContactSet locked);
  void build_ahead();

  Flows& flows_;
  Wake asked_;
  Wake built_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> waiting_{false};
  std::atomic<ContactSet> wanted_{0};  // of who waits
  std::int64_t awaited_ = 0;           // of the thread that waits
  ContactSet last_ = 0;                // of the builder: the last set that was asked for
  int next_ = 0;                       // and its next neighbour to build
  double memory_ = 0.0;                // of flows built ahead [bytes]
};

}  // namespace sprag
