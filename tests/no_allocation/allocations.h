// Counts the allocations of a thread. The executable replaces malloc and related functions, which
// operator new, Eigen and the libraries use as well. The replacements allocate as before and count
// while the calling thread's switch is on. gtest's assertions allocate: count first, assert
// afterwards.
#pragma once

#include <cstddef>

namespace sprag::test {

/// Counts every allocation of this thread from its construction to stop() or its destruction.
/// Deallocations count, too, since they take as long. Only one instance at a time.
class CountAllocations {
 public:
  CountAllocations();
  CountAllocations(const CountAllocations&) = delete;
  CountAllocations& operator=(const CountAllocations&) = delete;
  ~CountAllocations() { stop(); }

  /// Ends counting and returns the count.
  long stop();

  /// Size of the largest allocation [bytes].
  std::size_t largest() const;
};

/// The allocations of one call.
template <typename Call>
long allocations_of(Call&& call) {
  CountAllocations counting;
  call();
  return counting.stop();
}

}  // namespace sprag::test
