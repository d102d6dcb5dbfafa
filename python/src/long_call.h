// Runs a long computation without the interpreter's lock; Ctrl-C interrupts it.
#pragma once

#include <pybind11/pybind11.h>

#include <mutex>
#include <stop_token>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag::python {

/// While a relay exists, Ctrl-C also requests an interrupt of the computation, provided that Python
/// has a handler for it.
class InterruptRelay {
 public:
  InterruptRelay();
  InterruptRelay(const InterruptRelay&) = delete;
  InterruptRelay& operator=(const InterruptRelay&) = delete;
  ~InterruptRelay();

  /// Of the calls under way.
  std::stop_token token() const;
};

/// Raises the exception of Python's handler of Ctrl-C, or KeyboardInterrupt.
[[noreturn]] void raise_interrupt();

/// Returns the result of call() without the interpreter's lock; call() must not touch Python
/// objects.
template <typename Call>
auto without_lock(const Call& call) {
  const pybind11::gil_scoped_release released;
  return call();
}

/// The same with a mutex, which is taken without the interpreter's lock, and released before that
/// is taken again: this order excludes a deadlock.
template <typename Call>
auto locked(std::mutex& mutex, const Call& call) {
  const pybind11::gil_scoped_release released;
  const std::lock_guard lock(mutex);
  return call();
}

/// Returns the result of compute(), which must not touch Python objects. `stop` interrupts it.
template <typename Compute>
auto stoppable_call(const std::stop_token& stop, const Compute& compute) {
  try {
    const StopScope scope(stop);
    return without_lock(compute);
  } catch (const Interrupted&) {
    raise_interrupt();
  }
}

/// The same; Ctrl-C interrupts it.
template <typename Compute>
auto long_call(const Compute& compute) {
  const InterruptRelay relay;
  return stoppable_call(relay.token(), compute);
}

}  // namespace sprag::python
