// Cancellation of long computations by std::stop_token. A function that takes a token opens a
// StopScope; loops below it check the token of their thread.
#pragma once

#include <exception>
#include <stop_token>
#include <utility>

namespace sprag {

/// Thrown when a computation stops early. The object it worked on must not be used any more;
/// results returned before are valid.
struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

namespace detail {
inline thread_local const std::stop_token* thread_stop = nullptr;
}  // namespace detail

/// Makes a token that of the calling thread while the object exists. An empty token leaves that of
/// the enclosing scope.
class StopScope {
 public:
  explicit StopScope(std::stop_token stop) : stop_(std::move(stop)), outer_(detail::thread_stop) {
    if (stop_.stop_possible()) detail::thread_stop = &stop_;
  }
  ~StopScope() { detail::thread_stop = outer_; }
  StopScope(const StopScope&) = delete;
  StopScope& operator=(const StopScope&) = delete;

 private:
  std::stop_token stop_;
  const std::stop_token* outer_;
};

/// body with the token of the calling thread, for another thread to call.
template <typename Body>
auto with_stop_token(Body body) {
  std::stop_token stop;
  if (detail::thread_stop != nullptr) stop = *detail::thread_stop;
  return [body = std::move(body), stop = std::move(stop)] {
    const StopScope scope(stop);
    return body();
  };
}

inline bool interrupted() noexcept {
  return detail::thread_stop != nullptr && detail::thread_stop->stop_requested();
}

/// Throws Interrupted if a stop was requested. It costs two loads. Call it in every step that takes
/// more than a few microseconds.
inline void check_interrupt() {
  if (interrupted()) throw Interrupted();
}

}  // namespace sprag
