// The counter itself: a count of zero is evidence only if every way to allocate is counted.
#include "tests/no_allocation/allocations.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <thread>
#include <vector>

namespace sprag::test {
namespace {

// Makes the compiler assume that the address is used; otherwise it may omit an allocation.
void* volatile seen = nullptr;

TEST(CountAllocations, CountsEveryAllocationFunction) {
  const auto all = [] {
    for (void* memory : {std::malloc(100), std::calloc(10, 10), std::aligned_alloc(64, 128)}) {
      seen = memory;
      std::free(memory);
    }
  };
  EXPECT_EQ(allocations_of(all), 6);
  EXPECT_EQ(allocations_of([] {
              void* memory = nullptr;
              if (posix_memalign(&memory, 64, 128) == 0) seen = memory;
              std::free(memory);
            }),
            2);
  void* memory = std::malloc(10);
  EXPECT_GE(allocations_of([&] { seen = memory = std::realloc(memory, 100000); }), 1);
  EXPECT_EQ(allocations_of([&] { std::free(memory); }), 1);
  EXPECT_EQ(allocations_of([] { seen = ::operator new(100); }), 1);
  EXPECT_EQ(allocations_of([] { ::operator delete(seen); }), 1);
  EXPECT_EQ(allocations_of([] { seen = ::operator new (256, std::align_val_t{128}); }), 1);
  EXPECT_EQ(allocations_of([] { ::operator delete (seen, std::align_val_t{128}); }), 1);
  EXPECT_GE(allocations_of([] { seen = ::operator new(100, std::nothrow); }), 1);
  ::operator delete(seen);
}

TEST(CountAllocations, NotesTheLargest) {
  CountAllocations counting;
  for (const std::size_t size : {100, 3000, 20}) {
    seen = std::malloc(size);
    std::free(seen);
  }
  counting.stop();
  EXPECT_EQ(counting.largest(), 3000U);
}

TEST(CountAllocations, IsPerThread) {
  std::thread other;
  EXPECT_GT(allocations_of([&] { other = std::thread([] {}); }), 0);
  other.join();
  bool go = false;
  std::thread busy([&] {
    std::vector<int> vector(1000);
    seen = vector.data();
    go = true;
  });
  EXPECT_EQ(allocations_of([&] { busy.join(); }), 0);
  EXPECT_TRUE(go);
}

}  // namespace
}  // namespace sprag::test
