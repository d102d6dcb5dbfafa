// Builds flows (flows.h) in a thread of its own, since a flow of a machine with many modes takes
// milliseconds and allocates. A flow that the real-time loop needs comes first; the loop waits for
// it, and its ticks are late. Otherwise the builder works ahead: single contacts, then the sets
// that differ by one contact from the last requested set, up to a limit of memory.
#pragma once

#include <atomic>
#include <cstdint>

#include "observer/wake.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag {

class FlowBuilder {
 public:
  /// From now on only run(), called by another thread, builds flows. `flows` must outlive this, and
  /// this must outlive every use of `flows`.
  explicit FlowBuilder(Flows& flows);
  FlowBuilder(const FlowBuilder&) = delete;
  FlowBuilder& operator=(const FlowBuilder&) = delete;

  /// Builds until stop().
  void run();

  /// Ends run(). A thread that waits for a flow, or later requests one that has not been built,
  /// gets the exception Interrupted.
  void stop();

  /// Number of times that the loop waited for a flow.
  std::int64_t awaited() const { return awaited_; }

 private:
  void await(ContactSet locked);
  void build_ahead();

  Flows& flows_;
  Wake asked_;
  Wake built_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> waiting_{false};   // set by await(); cleared by run() when the flow is built
  std::atomic<ContactSet> wanted_{0};  // the set that the waiting thread needs
  std::int64_t awaited_ = 0;           // used by the waiting thread
  ContactSet last_ = 0;                // used by the builder: the last requested set
  int next_ = 0;         // the contact by which the next set built ahead differs from it
  double memory_ = 0.0;  // of flows built ahead [bytes]
};

}  // namespace sprag
