// A request to stop, set by a signal handler and checked by long computations between their steps.
// There is one for the process.
#pragma once

#include <atomic>
#include <exception>

namespace sprag {

/// Thrown when a computation stops early. The object it worked on must not be used any more;
/// results returned before are valid.
struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

namespace detail {
inline std::atomic<bool> interrupt_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");
}  // namespace detail

/// Safe in a signal handler.
inline void request_interrupt() noexcept { detail::interrupt_requested = true; }

/// Withdraws the request.
inline void clear_interrupt() noexcept { detail::interrupt_requested = false; }

inline bool interrupted() noexcept {
  return detail::interrupt_requested.load(std::memory_order_relaxed);
}

/// Throws Interrupted if a stop was requested. It costs one load. Call it in every step that takes
/// more than a few microseconds.
inline void check_interrupt() {
  if (interrupted()) throw Interrupted();
}

}  // namespace sprag
