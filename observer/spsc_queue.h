// A bounded lock-free queue from one thread to another. Its slots are allocated once and written in
// place, so that passing a value does not allocate.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

namespace sprag {

template <typename T>
class SpscQueue {
 public:
  /// `capacity` slots, each a copy of `prototype`.
  SpscQueue(std::size_t capacity, const T& prototype) : slots_(capacity + 1, prototype) {}

  /// Producer: the next free slot, or nullptr if the queue is full. push() passes it on.
  T* free_slot() {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    return next(tail) == head_.load(std::memory_order_acquire) ? nullptr : &slots_[tail];
  }
  void push() {
    tail_.store(next(tail_.load(std::memory_order_relaxed)), std::memory_order_release);
  }

  /// Consumer: the oldest value, or nullptr if the queue is empty. pop() frees its slot.
  T* front() {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    return head == tail_.load(std::memory_order_acquire) ? nullptr : &slots_[head];
  }
  void pop() {
    head_.store(next(head_.load(std::memory_order_relaxed)), std::memory_order_release);
  }

 private:
  std::size_t next(std::size_t i) const { return i + 1 == slots_.size() ? 0 : i + 1; }

  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
};

}  // namespace sprag
