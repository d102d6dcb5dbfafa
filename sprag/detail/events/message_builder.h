// Builds the messages of a master from its events: numbered, each with the last records.
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
  /// `session`: random per start of the master; `speed`: simulated s per wall s, infinite if
  /// unpaced.
  MessageBuilder(std::int64_t session, double speed, int contacts);

  /// Takes events in order of time.
  void add(std::span<const ContactEvent> events);

  /// Whether a message must be sent before the next heartbeat.
  bool pending() const { return sent_ < records_.size(); }

  /// Next message: all events up to `horizon`, or as many as fit; pending() then stays true.
  /// `utime`: wall clock at send [us].
  const ContactMessage& next(double horizon, std::int64_t utime);

  std::int64_t session() const { return message_.session; }
  std::int64_t sent() const { return message_.sequence; }

 private:
  ContactMessage message_;
  std::deque<ContactEvent> records_;  // last sent records, then those not sent yet
  std::size_t sent_ = 0;              // number of sent records in records_
};

}  // namespace sprag
