#include "observer/spsc_queue.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <thread>
#include <utility>

#include "tests/support/repetitions.h"

namespace sprag {
namespace {

TEST(SpscQueue, IsEmptyAtFirst) {
  SpscQueue<int> queue(3, 0);
  EXPECT_EQ(queue.front(), nullptr);
  EXPECT_NE(queue.free_slot(), nullptr);
  EXPECT_EQ(queue.front(), nullptr) << "a slot that was not pushed is not handed over";
}

TEST(SpscQueue, HoldsItsCapacityAndThenRefuses) {
  for (const std::size_t capacity : {1U, 2U, 7U}) {
    SpscQueue<std::size_t> queue(capacity, 0);
    for (std::size_t round = 0; round < 20; ++round) {
      for (std::size_t i = 0; i < capacity; ++i) {
        std::size_t* slot = queue.free_slot();
        ASSERT_NE(slot, nullptr);
        *slot = round + i;
        queue.push();
      }
      EXPECT_EQ(queue.free_slot(), nullptr);
      for (std::size_t i = 0; i < capacity; ++i) {
        ASSERT_NE(queue.front(), nullptr);
        EXPECT_EQ(*queue.front(), round + i);
        queue.pop();
        EXPECT_NE(queue.free_slot(), nullptr);
      }
      EXPECT_EQ(queue.front(), nullptr);
    }
  }
}

TEST(SpscQueue, SlotsAreCopiesOfThePrototypeAndAreUsedInPlace) {
  SpscQueue<std::string> queue(2, std::string(100, 'x'));
  std::string* first = queue.free_slot();
  EXPECT_EQ(*first, std::string(100, 'x'));
  queue.push();
  EXPECT_EQ(queue.front(), first);
}

// Each value is written twice, so that a slot that is read too early or overwritten too soon is
// detected.
TEST(SpscQueue, PassesManyValuesBetweenTwoThreadsInOrder) {
  const std::uint64_t count = static_cast<std::uint64_t>(repetitions(200'000));
  for (const std::size_t capacity : {1U, 3U, 1024U}) {
    const std::uint64_t values = capacity == 1024U ? count : count / 40;
    SpscQueue<std::pair<std::uint64_t, std::uint64_t>> queue(capacity, {0, 0});
    std::thread producer([&] {
      for (std::uint64_t i = 0; i < values; ++i) {
        auto* slot = queue.free_slot();
        while (slot == nullptr) {
          std::this_thread::yield();
          slot = queue.free_slot();
        }
        *slot = {i, ~i};
        queue.push();
      }
    });
    std::uint64_t wrong = 0;
    for (std::uint64_t i = 0; i < values; ++i) {
      auto* slot = queue.front();
      while (slot == nullptr) {
        std::this_thread::yield();
        slot = queue.front();
      }
      if (slot->first != i || slot->second != ~i) ++wrong;
      queue.pop();
    }
    producer.join();
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(queue.front(), nullptr);
  }
}

}  // namespace
}  // namespace sprag
