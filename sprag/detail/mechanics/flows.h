// Cache of the flows of one model (flow.h). The cost of building a flow grows with the cube of the
// number of coordinates.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/model.h"

namespace sprag {

/// Flows of one model by locked set. Each is built once and kept: by the calling thread at first
/// use, or by another thread (on_missing()). One thread may read while another builds.
class Flows {
 public:
  /// Builds free flight. Throws ModelError.
  explicit Flows(Model model);
  Flows(const Flows&) = delete;
  Flows& operator=(const Flows&) = delete;
  ~Flows();

  const Dynamics& dynamics() const { return dynamics_; }
  /// Takes new samples of a streamed input. Does not allocate. Not while another thread uses or
  /// builds flows.
  void follow_input();
  /// Throws ModelError as the constructor of Flow does.
  const Flow& operator[](ContactSet locked) const;
  /// Null where the constructor of Flow throws. Neither allocates nor throws if the flow has been
  /// built, or if another thread builds it.
  const Flow* find(ContactSet locked) const;

  /// Builds the flow unless it has been built. Not to be called by two threads at a time.
  void build(ContactSet locked) const;
  bool built(ContactSet locked) const { return entry(locked) != nullptr; }

  /// Sets the function that is called for a missing flow. It must return only after build() has
  /// been called for that set. Without it, the calling thread builds the flow.
  void on_missing(std::function<void(ContactSet)> build_elsewhere) {
    missing_ = std::move(build_elsewhere);
  }

 private:
  struct Entry;
  const Entry* entry(ContactSet locked) const;
  const Entry* entry_when_built(ContactSet locked) const;
  std::atomic<const Entry*>& slot(ContactSet locked) const;

  Dynamics dynamics_;
  // Open addressing; entries are added, never moved or removed.
  mutable std::vector<std::atomic<const Entry*>> slots_;
  mutable std::vector<std::unique_ptr<Entry>> entries_;
  std::function<void(ContactSet)> missing_;
};

/// Builds flows that a machine driven by contact events is likely to need, sets of few locked
/// contacts first, up to a limit of the total cost.
void build_foreseeable(const Flows& flows);

}  // namespace sprag
