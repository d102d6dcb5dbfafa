// A machine of one's own as a master on the bus. It takes contact events and does what else a
// master has to do: a session, numbered messages that repeat the last events, the horizon, a
// heartbeat, a goodbye.
//
//   sprag::EventPublisher publisher(1, {});        // one contact
//   publisher.take({0.4565, 0, sprag::ContactEventKind::pulse});
//   publisher.set_horizon(0.46);                   // sent at once, with all that it makes known
//
// Threads may share one.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "lcmtypes/key.h"
#include "lcmtypes/lcm_url.h"
#include "sprag/contact_event.h"

namespace sprag {

struct PublisherSettings {
  std::string url = default_url;
  std::optional<Key> key = std::nullopt;
  double speed = 1.0;  ///< simulated s per wall s, > 0; +infinity for a machine without a pace
};

class EventPublisher {
 public:
  /// A new session of a machine with `contacts` contacts. Throws BusError, UrlError, or
  /// std::invalid_argument.
  EventPublisher(int contacts, const PublisherSettings& settings);
  EventPublisher(EventPublisher&&) noexcept;
  EventPublisher& operator=(EventPublisher&&) noexcept;
  ~EventPublisher();  ///< close()

  /// Takes an event behind the horizon, in any order; it is sent when the horizon reaches it. False
  /// if it is not behind the horizon or the publisher is closed. Throws std::invalid_argument for a
  /// time that is no number >= 0 or a contact that the machine does not have.
  bool take(const ContactEvent& event);

  /// Every event up to t has been taken; never goes back. Sends what became known at once, and the
  /// horizon alone every 10 ms. To be called with the machine's time at least ten times a second,
  /// also while nothing happens: observers settle no further, and a machine that is silent for 0.1
  /// s makes way for another. Throws std::invalid_argument if t is no number >= 0.
  void set_horizon(double t);

  /// The last message is repeated for 0.2 s, since none follows that would repair its loss.
  void close() noexcept;

  std::int64_t session() const;  ///< random
  std::int64_t sent() const;     ///< messages
  std::int64_t unsent() const;   ///< messages that could not be sent

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

}  // namespace sprag
