// A master's messages of contacts on the bus: a random session, numbers, the last events in every
// message, heartbeats, and a goodbye.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "sprag/detail/events/message_builder.h"

namespace sprag {

class ContactSender {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr auto heartbeat = std::chrono::milliseconds(10);
  /// The last message goes out so many times, a heartbeat apart: nothing follows that would repair
  /// its loss.
  static constexpr int goodbyes = 20;

  /// A new session of a machine with `contacts` contacts; `speed`: simulated s per wall s, infinite
  /// if unpaced. `bus` must outlive this.
  ContactSender(Bus& bus, int contacts, double speed);

  /// Takes events that have happened, in order.
  void add(std::span<const ContactEvent> events) { builder_.add(events); }

  /// Whether there are events to send, or it is time for a heartbeat.
  bool due() const { return builder_.pending() || Clock::now() >= next_; }
  /// When the next heartbeat is due.
  Clock::time_point next() const { return next_; }

  /// Sends that all is known up to `horizon` [s], with the events that were added.
  void send(double horizon);

  std::int64_t session() const { return builder_.session(); }
  std::int64_t messages() const { return builder_.sent(); }
  std::int64_t unsent() const { return unsent_; }  ///< of them, those that could not be sent

 private:
  Bus& bus_;
  MessageBuilder builder_;
  EncodedContacts bytes_{};
  std::int64_t unsent_ = 0;
  Clock::time_point next_ = Clock::time_point::min();
};

}  // namespace sprag
