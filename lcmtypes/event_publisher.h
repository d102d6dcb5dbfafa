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

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_sender.h"
#include "lcmtypes/input_sender.h"
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
  EventPublisher(const EventPublisher&) = delete;
  EventPublisher& operator=(const EventPublisher&) = delete;
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

  std::int64_t session() const { return sender_.session(); }  ///< random
  std::int64_t sent() const;                                  ///< messages of both channels
  std::int64_t unsent() const;                                ///< messages that could not be sent

 private:
  void beat(const std::stop_token& stop);
  bool begun() const { return said_ >= 0.0; }  // a contact message has been sent
  void send();

  int contacts_;
  bool paced_;
  std::mutex closing_;
  mutable std::mutex mutex_;  // protects all members below
  std::condition_variable_any wake_;
  Bus bus_;
  ContactSender sender_;
  std::optional<InputSender> input_sender_;  // after start_input()
  // Samples until the first contact message, by which observers know the session.
  std::vector<std::pair<std::int64_t, double>> early_;
  std::vector<ContactEvent> waiting_;  // later than the watermark, in order
  double horizon_ = -1.0;              // watermark; -1: none yet
  double said_ = -1.0;                 // watermark of the last message
  int repeats_ = 0;                    // number of messages that repeated it
  bool closed_ = false;
  std::jthread beats_;  // last member: it uses all others
};

}  // namespace sprag
