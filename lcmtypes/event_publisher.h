// Publishes a user's machine as a master on the bus. It takes contact events and does everything
// else that a master must do: a session number, numbered messages that repeat the last events, the
// watermark, heartbeats, and final messages.
//
//   sprag::EventPublisher publisher(1, {});        // one contact
//   publisher.take({0.4565, 0, sprag::ContactEventKind::pulse});
//   publisher.set_horizon(0.46);                   // sends all events up to 0.46 s
//
// Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "lcmtypes/key.h"
#include "lcmtypes/lcm_url.h"
#include "sprag/contact_event.h"

namespace sprag {

struct PublisherSettings {
  std::string url = default_url;
  std::optional<Key> key = std::nullopt;
  double speed = 1.0;  ///< simulated s per wall s, > 0; +infinity: unpaced
  /// Receives every message as it is sent, for a recording. Called in several threads, but not at
  /// the same time; must not throw.
  std::function<void(std::string_view channel, std::span<const std::uint8_t> message)> copy =
      nullptr;
};

class EventPublisher {
 public:
  /// Starts a new session of a machine with `contacts` contacts. Throws BusError, UrlError, or
  /// std::invalid_argument.
  EventPublisher(int contacts, const PublisherSettings& settings);
  EventPublisher(EventPublisher&&) noexcept;
  EventPublisher& operator=(EventPublisher&&) noexcept;
  ~EventPublisher();  ///< close()

  /// Takes an event later than the watermark; the order does not matter. The event is sent when the
  /// watermark reaches it. Returns false if it is not later than the watermark or the publisher is
  /// closed. Throws std::invalid_argument for a time that is not a finite number >= 0, or an
  /// unknown contact.
  bool take(const ContactEvent& event);

  /// Sets the watermark: every event up to t has been taken. It never decreases. Sends new events
  /// at once, and the watermark alone every 10 ms. To be called with the machine's time at least
  /// ten times a second, even without events: observers settle no further, and after 0.1 s of
  /// silence another master may take over. Throws std::invalid_argument if t is not a finite number
  /// >= 0.
  void set_horizon(double t);

  /// Begins the samples of the excitation, for observers of a scene with a streamed excitation:
  /// sample k has the time t0 + k dt. To be called once at most. Throws std::invalid_argument for a
  /// second call, t0 that is not finite, or dt that is not a finite number > 0.
  void start_input(double t0, double dt);

  /// Takes sample k of the excitation, and sends it within about 10 ms, but not before the first
  /// watermark, since observers ignore samples of an unknown session. Numbers that are left out are
  /// samples that do not exist: observers interpolate them and report it. Returns false if k is not
  /// greater than all before or the publisher is closed. Throws std::invalid_argument before
  /// start_input(), for k that is not from 0 to 2^53 - 1, or a value that is not finite.
  bool take_sample(std::int64_t k, double value);

  /// Repeats the last messages for 0.2 s, since no later ones would repair their loss.
  void close() noexcept;

  std::int64_t session() const;  ///< random
  std::int64_t sent() const;     ///< messages of both channels
  std::int64_t unsent() const;   ///< messages that could not be sent

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

}  // namespace sprag
