// Content of a message on SPRAG_CONTACTS: the last records of a master's contact events and the
// watermark. Each message repeats the last records, so that it repairs lost messages before it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "sprag/contact_event.h"

namespace sprag {

inline constexpr int max_records = 120;

struct ContactMessage {
  std::int64_t session = 0;   ///< random per master start
  std::int64_t sequence = 0;  ///< message number within the session
  std::int64_t utime = 0;     ///< wall clock at send [us]
  double speed = 1.0;         ///< simulated s per wall s; +infinity for an unpaced master
  double horizon = 0.0;   ///< watermark: every event up to this simulated time has been sent [s]
  ContactSet closed = 0;  ///< chi at the horizon
  int contacts = 0;       ///< m
  std::int64_t records_total = 0;  ///< records of the session so far
  int records = 0;                 ///< number of used entries of `record`, oldest first
  std::array<ContactEvent, max_records> record{};
};

/// Converts the times of a message from the contact clock to the machine's time. A watermark before
/// the machine's t = 0 becomes 0. A true clock changes nothing.
inline void to_machine_time(const ContactClock& clock, ContactMessage& message) {
  if (clock.is_true()) return;
  message.speed /= clock.rate;
  message.horizon = std::max(machine_time(clock, message.horizon), 0.0);
  for (int i = 0; i < message.records; ++i) {
    ContactEvent& event = message.record[static_cast<std::size_t>(i)];
    event.t = machine_time(clock, event.t);
  }
}

}  // namespace sprag
