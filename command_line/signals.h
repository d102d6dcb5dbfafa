// Converts the signals SIGINT, SIGTERM and SIGHUP to a request to stop
// (sprag/detail/mechanics/interrupt.h).
#pragma once

#include <string>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {

/// Whether one of these signals has arrived since the last Signals object began. In any thread.
bool stop_requested() noexcept;

/// Catches these signals; SIGHUP only if it is not ignored, as it is under nohup. If the program
/// has not ended 0.9 s after the first signal (15 s with sanitizers), it cannot check the request,
/// since it is inside a library or a blocked write. Then a message goes to stderr and the process
/// ends at once with exit code 1. One object at a time.
class Signals {
 public:
  explicit Signals(const std::string& program);
  /// Cancels the timer. The signals remain caught.
  ~Signals();
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

 private:
  StopScope scope_;
};

}  // namespace sprag
