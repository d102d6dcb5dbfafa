// "Now" in simulated time, seen from outside: a paced master's messages say how far it was and what
// its wall clock showed when they were sent. Where that makes a delay of 0 to 1 s the delay is
// taken off; else the clocks disagree, and it counts as none. Of the last seconds the message that
// is the furthest ahead counts (the lower envelope of the delays), so that jitter does not matter.
// A horizon that is lower than that of an earlier message says that the machine's clock was set
// back: the messages before do not count any more.
//
// A master's clock that is ahead by delta <= 1 s puts "now" behind by the least delay or
// speed delta, whichever is less; one that is behind by delta puts it ahead by speed delta. Settled
// ticks do not depend on it. Local times are monotonic nanoseconds.
#pragma once

#include <cstdint>

#include "recording/arrival.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

class MasterClock {
 public:
  void restart() { *this = MasterClock(); }

  void observe(const ContactMessage& message, const Arrival& arrival);

  bool running() const { return received_; }
  /// Simulated s per local s; infinite for an unpaced master.
  double speed() const { return speed_; }

  /// Simulated time at a local time; an unpaced master's is its last horizon.
  double simulated(std::int64_t local) const;

  /// Local time at which the simulated time t is reached; only for a paced master.
  std::int64_t local(double t) const;

 private:
  double origin() const;

  bool received_ = false;
  double speed_ = 1.0;
  double horizon_ = 0.0;
  // Of the message with the largest number: number and horizon.
  std::int64_t last_number_ = 0;
  double last_horizon_ = 0.0;
  std::int64_t first_number_ = 0;  // messages with lower ones are from before a step back
  std::int64_t epoch_ = 0;         // local time of the first message: keeps the numbers small
  std::int64_t window_start_ = 0;
  double best_ = 0.0;           // largest horizon - speed (sent - epoch) of this window
  double previous_best_ = 0.0;  // and of the window before
};

}  // namespace sprag
