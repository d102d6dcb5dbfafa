// Turns a master's events into the messages it sends: numbered, the last records in every one.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

class MessageBuilder {
 public:
  /// `session`: random per master start; `speed`: simulated s per wall s, infinite if unpaced.
  MessageBuilder(std::int64_t session, double speed, int contacts);

  /// Takes events that have happened, in order.
  void add(std::span<const ContactEvent> events);

  /// Whether a message has to go out before its heartbeat is due.
  bool pending() const { return sent_ < records_.size(); }

  /// The next message: everything up to `horizon`, or, when that does not fit, as much as does;
  /// pending() then stays true. `utime` is the wall clock at send [us].
  const ContactMessage& next(double horizon, std::int64_t utime);

  std::int64_t session() const { return message_.session; }
  std::int64_t sent() const { return message_.sequence; }

 private:
  ContactMessage message_;
  std::deque<ContactEvent> records_;  // the last ones, sent and not yet sent
  std::size_t sent_ = 0;              // how many of records_ have been sent
};

}  // namespace sprag
