// Threads that all end after the first exception in one of them. The exception is kept for the
// thread that started them: if it left its thread, it would end the process without a report and
// with truncated files.
#pragma once

#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {

class ThreadGroup {
 public:
  /// `stop` requests all bodies to return. It is called by the thread of a body that has thrown,
  /// and by end(). It must not throw and may be called repeatedly.
  explicit ThreadGroup(std::function<void()> stop) : stop_(std::move(stop)) {}
  ~ThreadGroup() { end(); }
  ThreadGroup(const ThreadGroup&) = delete;
  ThreadGroup& operator=(const ThreadGroup&) = delete;

  /// Runs body() in a thread of its own.
  template <typename Body>
  void start(Body body) {
    threads_.emplace_back(with_stop_token([this, body = std::move(body)] { run(body); }));
  }

  /// Runs body() in the calling thread as a member of the group.
  template <typename Body>
  void run(const Body& body) noexcept {
    try {
      body();
    } catch (...) {
      keep(std::current_exception());
      stop_();
    }
  }

  /// Stops all bodies and waits until they have returned.
  void end() noexcept {
    stop_();
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

  /// After end(): rethrows the first exception of a body, if any.
  void rethrow() const {
    if (first_) std::rethrow_exception(first_);
  }

 private:
  void keep(std::exception_ptr exception) noexcept {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!first_) first_ = std::move(exception);
  }

  std::function<void()> stop_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::exception_ptr first_;
};

}  // namespace sprag
