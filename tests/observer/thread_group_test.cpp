#include "observer/thread_group.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>

namespace sprag {
namespace {

using namespace std::chrono_literals;

class ThreadGroupTest : public ::testing::Test {
 protected:
  void until_stopped() {
    while (!stop_) std::this_thread::sleep_for(1ms);
    ++ended_;
  }

  /// The message of the exception that the caller gets; empty: none.
  std::string rethrown() const {
    try {
      threads_.rethrow();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  }

  std::atomic<bool> stop_ = false;
  std::atomic<int> ended_ = 0;
  ThreadGroup threads_{[this] { stop_ = true; }};
};

TEST_F(ThreadGroupTest, ExceptionEndsOthersAndReachesCaller) {
  threads_.start([this] { until_stopped(); });
  threads_.start([] { throw std::runtime_error("no flow"); });
  threads_.run([this] { until_stopped(); });
  threads_.end();
  EXPECT_EQ(ended_, 2);
  EXPECT_EQ(rethrown(), "no flow");
}

TEST_F(ThreadGroupTest, FirstExceptionIsRethrown) {
  threads_.start([this] {
    until_stopped();
    throw std::runtime_error("second");
  });
  threads_.run([] { throw std::runtime_error("first"); });
  threads_.end();
  EXPECT_EQ(rethrown(), "first");
}

TEST_F(ThreadGroupTest, WithoutExceptionNothingIsThrown) {
  threads_.start([this] { until_stopped(); });
  threads_.end();
  threads_.end();
  EXPECT_EQ(ended_, 1);
  EXPECT_EQ(rethrown(), "");
}

TEST_F(ThreadGroupTest, NoThreadOutlivesTheGroup) {
  {
    ThreadGroup inner([this] { stop_ = true; });
    inner.start([this] { until_stopped(); });
  }
  EXPECT_EQ(ended_, 1);
}

}  // namespace
}  // namespace sprag
