// Pool of filter beliefs that estimator states share through counted references. A belief changes
// at events only, so all states of the ticks between two events refer to the same belief. A copy of
// a state increments a count and copies no covariance.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "sprag/detail/filter/filter_belief.h"

namespace sprag {

class BeliefPool;

/// Counted reference to a belief of a pool, or empty. The pool must outlive it. The count is not
/// atomic: one thread only.
class BeliefRef {
 public:
  BeliefRef() = default;
  BeliefRef(const BeliefRef& other);
  BeliefRef(BeliefRef&& other) noexcept : slot_(std::exchange(other.slot_, nullptr)) {}
  BeliefRef& operator=(BeliefRef other) noexcept {
    std::swap(slot_, other.slot_);
    return *this;
  }
  ~BeliefRef();

  explicit operator bool() const { return slot_ != nullptr; }
  const FilterBelief& operator*() const;
  const FilterBelief* operator->() const { return &**this; }

 private:
  friend class BeliefPool;
  struct Slot;
  explicit BeliefRef(Slot* slot) : slot_(slot) {}
  Slot* slot_ = nullptr;
};

struct BeliefRef::Slot {
  FilterBelief belief;
  std::size_t references = 0;
  BeliefPool* pool = nullptr;
};

class BeliefPool {
 public:
  /// Allocates `capacity` beliefs of the size of `example`.
  BeliefPool(const FilterBelief& example, std::size_t capacity);
  BeliefPool(const BeliefPool&) = delete;
  BeliefPool& operator=(const BeliefPool&) = delete;

  /// Copies the belief into the pool. Returns an empty reference if the pool is full. Does not
  /// allocate.
  BeliefRef put(const FilterBelief& belief);

 private:
  friend class BeliefRef;
  std::vector<BeliefRef::Slot> slots_;
  std::vector<BeliefRef::Slot*> free_;
};

inline BeliefRef::BeliefRef(const BeliefRef& other) : slot_(other.slot_) {
  if (slot_ != nullptr) ++slot_->references;
}
inline BeliefRef::~BeliefRef() {
  if (slot_ != nullptr && --slot_->references == 0) slot_->pool->free_.push_back(slot_);
}
inline const FilterBelief& BeliefRef::operator*() const { return slot_->belief; }

inline BeliefPool::BeliefPool(const FilterBelief& example, std::size_t capacity)
    : slots_(capacity) {
  free_.reserve(capacity);
  // Covariances are allocated but not written, so that the operating system maps a page at its
  // first use.
  FilterBelief small = example;
  small.S.resize(0, 0);
  for (BeliefRef::Slot& slot : slots_) {
    slot.belief = small;
    slot.belief.S.resize(example.S.rows(), example.S.cols());
    slot.pool = this;
    free_.push_back(&slot);
  }
}

inline BeliefRef BeliefPool::put(const FilterBelief& belief) {
  if (free_.empty()) return {};
  BeliefRef::Slot* slot = free_.back();
  free_.pop_back();
  slot->belief = belief;
  slot->references = 1;
  return BeliefRef(slot);
}

}  // namespace sprag
