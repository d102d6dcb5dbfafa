// Counts what a thread allocates. The executable brings its own malloc and its relatives, through
// which operator new, Eigen and the libraries go as well; they allocate as before and count while
// the calling thread's switch is on. gtest's assertions allocate: count first, assert afterwards.
#pragma once

namespace sprag::test {

/// From its construction to stop() or its end every allocation of this thread counts; giving memory
/// back counts, too, since it takes as long. One at a time.
class CountAllocations {
 public:
  CountAllocations();
  CountAllocations(const CountAllocations&) = delete;
  CountAllocations& operator=(const CountAllocations&) = delete;
  ~CountAllocations() { stop(); }

  /// Returns the count; what comes after it does not count.
  long stop();
};

/// Of one call.
template <typename Call>
long allocations_of(Call&& call) {
  CountAllocations counting;
  call();
  return counting.stop();
}

}  // namespace sprag::test
