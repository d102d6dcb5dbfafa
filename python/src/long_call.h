// A long computation: without the interpreter's lock, and broken off by Ctrl-C.
#pragma once

#include <pybind11/pybind11.h>

#include <stop_token>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag::python {

/// While one exists, Ctrl-C requests an interrupt as well, if Python handles it at all.
class InterruptRelay {
 public:
  InterruptRelay();
  InterruptRelay(const InterruptRelay&) = delete;
  InterruptRelay& operator=(const InterruptRelay&) = delete;
  ~InterruptRelay();

  /// Of the calls under way.
  std::stop_token token() const;
};

/// Raises what Python's handler of Ctrl-C raises, or KeyboardInterrupt.
[[noreturn]] void raise_interrupt();

/// What compute() returns. It must not touch Python's objects.
template <typename Compute>
auto long_call(const Compute& compute) {
  try {
    const InterruptRelay relay;
    const StopScope scope(relay.token());
    const pybind11::gil_scoped_release released;
    return compute();
  } catch (const Interrupted&) {
    raise_interrupt();
  }
}

}  // namespace sprag::python
