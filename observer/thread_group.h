// Threads whose first exception ends them all. It is kept for the thread that started them: an
// exception that leaves a thread would end the process, without a report and with cut files.
#pragma once

#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace sprag {

class ThreadGroup {
 public:
  /// `stop` asks all bodies to return. It is called when a body has thrown, from its thread; it
  /// must not throw, and may be called again.
  explicit ThreadGroup(std::function<void()> stop) : stop_(std::move(stop)) {}
  ~ThreadGroup() { end(); }
  ThreadGroup(const ThreadGroup&) = delete;
  ThreadGroup& operator=(const ThreadGroup&) = delete;

  /// Runs body() in a thread of its own.
  template <typename Body>
  void start(Body body) {
    threads_.emplace_back([this, body = std::move(body)] { run(body); });
  }

  /// Runs body() in the calling thread, as one of the group's.
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

  /// After end(): throws the first exception that left a body, if any did.
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
