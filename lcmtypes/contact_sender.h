// Sends a master's contact messages on the bus: a random session number, message numbers, the last
// events in every message, heartbeats, and final messages.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/events/message_builder.h"

namespace sprag {

class ContactSender {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr auto heartbeat = std::chrono::milliseconds(10);
  /// Number of repetitions of the last message, one heartbeat apart: no message follows that would
  /// repair its loss.
  static constexpr int goodbyes = 20;

  /// Starts a new session of a machine with `contacts` contacts. `speed`: simulated s per wall s,
  /// infinite if unpaced. `bus` must outlive this.
  ContactSender(Bus& bus, int contacts, double speed);

  /// Adds events, in order of time.
  void add(std::span<const ContactEvent> events) { builder_.add(events); }

  /// Whether events are pending or a heartbeat is due.
  bool due() const { return builder_.pending() || Clock::now() >= next_; }
  /// Time at which the next heartbeat is due.
  Clock::time_point next() const { return next_; }

  /// Sends the added events with the watermark `horizon` [s].
  void send(double horizon);

  std::int64_t session() const { return builder_.session(); }
  std::int64_t messages() const { return builder_.sent(); }
  std::int64_t unsent() const { return unsent_; }  ///< messages that could not be sent

 private:
  Bus& bus_;
  MessageBuilder builder_;
  std::vector<std::uint8_t> buffer_;
  std::int64_t unsent_ = 0;
  Clock::time_point next_ = Clock::time_point::min();
};

}  // namespace sprag
