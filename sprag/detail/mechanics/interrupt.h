// A request to stop, as a signal handler makes it, and what long computations ask between their
// steps. There is one for the process.
#pragma once

#include <atomic>
#include <exception>

namespace sprag {

/// A computation was broken off where it stood: what it works on is not to be used any more, what
/// it has handed out before is right.
struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

namespace detail {
inline std::atomic<bool> interrupt_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");
}  // namespace detail

/// Safe in a signal handler.
inline void request_interrupt() noexcept { detail::interrupt_requested = true; }

/// Takes the request back.
inline void clear_interrupt() noexcept { detail::interrupt_requested = false; }

inline bool interrupted() noexcept {
  return detail::interrupt_requested.load(std::memory_order_relaxed);
}

/// Throws Interrupted if a stop was requested. Costs a load: call it at every step that takes more
/// than some microseconds.
inline void check_interrupt() {
  if (interrupted()) throw Interrupted();
}

}  // namespace sprag
