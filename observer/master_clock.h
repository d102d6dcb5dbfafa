// "Now" in simulated time, seen from outside: a paced master's reports say how far it was when they
// were sent, each arrives after a delay, and the least delayed one of the last seconds comes
// closest (the lower envelope of the delays). Local times are monotonic nanoseconds.
#pragma once

#include <cstdint>

#include "mechanics/contact_report.h"

namespace sprag {

class MasterClock {
 public:
  void restart() { *this = MasterClock(); }

  /// A report that arrived at local time `arrival`.
  void observe(const ContactReport& report, std::int64_t arrival);

  bool running() const { return heard_; }
  /// Simulated s per local s; infinite for an unpaced master.
  double speed() const { return speed_; }

  /// Simulated time at a local time; an unpaced master's is its last horizon.
  double simulated(std::int64_t local) const;

  /// Local time at which the simulated time t is reached; only for a paced master.
  std::int64_t local(double t) const;

 private:
  double origin() const;

  bool heard_ = false;
  double speed_ = 1.0;
  double horizon_ = 0.0;
  std::int64_t epoch_ = 0;  // local time of the first report: keeps the numbers small
  std::int64_t window_start_ = 0;
  double best_ = 0.0;           // largest horizon - speed (arrival - epoch) of this window
  double previous_best_ = 0.0;  // and of the window before
};

}  // namespace sprag
