// The flows of one model (flow.h), kept for all who need them: a flow takes work to build, in
// proportion to the cube of the number of coordinates.
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

/// Flows of one model by locked set, each built once and kept: at first use by who asks for it, or
/// by another thread (on_missing()). One thread may ask while another builds.
class Flows {
 public:
  /// Builds free flight. Throws ModelError.
  explicit Flows(Model model);
  Flows(const Flows&) = delete;
  Flows& operator=(const Flows&) = delete;
  ~Flows();

  const Dynamics& dynamics() const { return dynamics_; }
  /// Throws ModelError as Flow does.
  const Flow& operator[](ContactSet locked) const;
  /// Null where Flow throws. Neither allocates nor throws where the flow is there already, or
  /// where another thread builds it.
  const Flow* find(ContactSet locked) const;

  /// Builds what is not there yet. Not by two threads at a time.
  void build(ContactSet locked) const;
  bool built(ContactSet locked) const { return entry(locked) != nullptr; }

  /// Whoever asks for a flow that is not there calls `build_elsewhere`, which must return when
  /// build() has been called for it; with none it is built at once, by who asks.
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
  mutable std::vector<std::unique_ptr<const Entry>> entries_;
  std::function<void(ContactSet)> missing_;
};

/// Builds the flows that a machine driven by contact events is likely to meet, as far as that is
/// cheap: those of few locked contacts first.
void build_foreseeable(const Flows& flows);

}  // namespace sprag
