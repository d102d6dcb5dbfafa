// A simulated machine for a live observer: well-formed messages at a pace, from any time on, and
// single spoilt messages.
#pragma once

#include <chrono>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/events_file.h"

namespace sprag::test {

class PlayedMaster {
 public:
  /// Its clock shows `start` now and runs at `speed`.
  PlayedMaster(const std::string& url, int contacts, double speed = 1.0, double start = 0.0,
               std::optional<Key> key = std::nullopt, std::int64_t session = 7)
      : bus_(url, std::move(key)),
        builder_(session, speed, contacts),
        speed_(speed),
        start_(start),
        began_(Clock::now()) {
    last_.session = session;
    last_.speed = speed;
    last_.contacts = contacts;
  }

  double now() const {
    return start_ + speed_ * std::chrono::duration<double>(Clock::now() - began_).count();
  }

  /// Shifts its clock by `step`.
  void step_clock(double step) { start_ += step; }

  /// Events to come, times ascending.
  void add(std::span<const ContactEvent> events) {
    events_.insert(events_.end(), events.begin(), events.end());
  }

  /// Sends events at their times and heartbeats until its clock shows `end`.
  void play_until(double end) {
    while (true) {
      const double t = std::min(now(), end);
      send(t);
      if (t >= end) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void play_for(double duration) { play_until(now() + duration); }

  /// One message, changed by spoil(report); it does not affect later messages.
  template <typename Spoil>
  void send_spoilt(const Spoil& spoil) {
    ContactMessage report = last_;
    ++report.sequence;
    report.utime = wall_clock();
    report.horizon = now();
    spoil(report);
    publish(report);
  }

  const ContactMessage& last() const { return last_; }
  std::int64_t sent() const { return builder_.sent(); }

 private:
  using Clock = std::chrono::steady_clock;

  static std::int64_t wall_clock() {
    return std::chrono::duration_cast<std::chrono::microseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
  }

  void send(double t) {
    std::size_t due = next_;
    while (due < events_.size() && events_[due].t <= t) ++due;
    builder_.add(std::span(events_).subspan(next_, due - next_));
    next_ = due;
    do {
      last_ = builder_.next(t, wall_clock());
      publish(last_);
    } while (builder_.pending());
  }

  void publish(const ContactMessage& report) {
    encode(report, message_);
    (void)bus_.publish(contacts_channel, message_);
  }

  Bus bus_;
  MessageBuilder builder_;
  double speed_, start_;
  Clock::time_point began_;
  std::vector<ContactEvent> events_;
  std::size_t next_ = 0;
  ContactMessage last_;
  std::vector<std::uint8_t> message_;
};

}  // namespace sprag::test
