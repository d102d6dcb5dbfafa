// Signals that end a program: SIGINT, SIGTERM and SIGHUP become a request to stop
// (detail/mechanics/interrupt.h).
#pragma once

#include <string>

namespace sprag {

/// Catches them; SIGHUP not where it is ignored, as under nohup. A program that has not ended 0.9 s
/// after the first of them (a sanitized build: 15 s) is where it cannot look at requests, inside a
/// library or a blocked write: then it says so on stderr and the process ends there with exit code
/// 1. One object at a time.
class Signals {
 public:
  explicit Signals(const std::string& program);
  /// From here on nothing ends the process any more, and no stop is requested.
  ~Signals();
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;
};

}  // namespace sprag
