// The present simulated time ("now") of a paced master. Each message carries the master's simulated
// time and its wall clock at send. A delay of 0 to 1 s by the two wall clocks is subtracted;
// otherwise the clocks disagree, and the delay counts as zero. Of the last seconds the message that
// is furthest ahead counts (the lower envelope of the delays), so that network jitter has no
// effect. A watermark below that of an earlier message means that the machine's clock was set back;
// earlier messages are then disregarded.
//
// If the master's clock is ahead by delta <= 1 s, "now" is late by the lesser of the least delay
// and speed * delta. If it lags by delta, "now" is early by speed * delta. Settled ticks do
// not depend on it. Local times are monotonic nanoseconds.
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

  /// Simulated time at a local time; for an unpaced master its last watermark.
  double simulated(std::int64_t local) const;

  /// Local time at which the simulated time t is reached; for a paced master only.
  std::int64_t local(double t) const;

 private:
  double origin() const;

  bool received_ = false;
  double speed_ = 1.0;
  double horizon_ = 0.0;
  // Number and watermark of the message with the largest number.
  std::int64_t last_number_ = 0;
  double last_horizon_ = 0.0;
  std::int64_t first_number_ = 0;  // messages with lower numbers precede the last step back
  std::int64_t epoch_ = 0;         // local time of the first message, an origin that keeps digits
  std::int64_t window_start_ = 0;
  double best_ = 0.0;           // largest horizon - speed (sent - epoch) of this window
  double previous_best_ = 0.0;  // the same of the previous window
};

}  // namespace sprag
