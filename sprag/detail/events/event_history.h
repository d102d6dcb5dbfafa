// The contact events an observer believes in: what its master's messages add up to. Reports may be
// lost, doubled or reordered; every one repeats the last records, and records are numbered, so that
// each is taken once and a gap is seen. Knows nothing of ticks, clocks or transport.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

inline constexpr double no_horizon = -1.0;

/// Simulated times between which events may be missing.
struct DegradedInterval {
  double from = 0.0;
  double to = 0.0;
  std::int64_t start = 0;  ///< which start of the time line it belongs to, from 1
  /// One record is missing, and it was a pulse: the numbers of the records and `closed` say so.
  bool one_pulse = false;
};

/// Why an event was skipped.
enum class Skip { backwards, beyond_horizon, unknown_contact, contradicting };
inline constexpr std::size_t skips = 4;

struct EventCounts {
  std::int64_t events = 0;        ///< taken, made up ones included
  std::int64_t made_up = 0;       ///< so that chi follows a message after a gap
  std::int64_t lost_records = 0;  ///< never seen: the gap was longer than a message's repeats
  std::array<std::int64_t, skips> skipped{};  ///< by Skip

  std::int64_t of(Skip cause) const { return skipped[static_cast<std::size_t>(cause)]; }
};

/// An event is skipped if it is earlier than the one before or not after a declared horizon
/// (`backwards`), later than its own message's horizon, of a contact that the machine does not
/// have, or if it closes or is a pulse while closed or opens while open (`contradicting`). What was
/// skipped counts as a gap: the estimate does not know it.
class EventHistory {
 public:
  /// For a machine with m contacts. Room for `capacity` events at a time; no allocation while they
  /// suffice.
  EventHistory(int contacts, std::size_t capacity);

  /// Forgets everything: the first record to come is number `next_record`, chi before it is `chi`,
  /// every event up to `horizon` is known (nothing yet: `no_horizon`).
  void restart(std::int64_t next_record, ContactSet chi, double horizon);

  /// Takes what is new in a message of the present session; returns how many events were appended.
  /// After a gap chi follows the message's `closed`: what the lost records did is made up where the
  /// gap ends.
  std::size_t add(const ContactMessage& message);

  /// Takes one event from a file; false if it was skipped.
  bool add(const ContactEvent& event);

  /// Declares that every event up to t is known; never goes back.
  void set_horizon(double t);

  const std::vector<ContactEvent>& events() const { return events_; }
  /// The last event that was skipped for this.
  const ContactEvent& last_skipped(Skip cause) const {
    return last_skipped_[static_cast<std::size_t>(cause)];
  }

  /// Counts the records before a message as lost, without taking any: restart() follows.
  void lose(const ContactMessage& message);

  /// Events may be missing from `from` on, or from the horizon if that is later, up to `to`.
  void degrade(double from, double to, bool one_pulse = false);
  /// No event since the last restart() is missing up to here, as far as is known; +infinity: none
  /// at all.
  double complete_to() const { return complete_to_; }

  /// Whether records before time t are known to be lost: in a degraded interval of this start that
  /// holds t, or after whose end at most `events` events have come up to t.
  bool lost_before(double t, std::size_t events) const;

  /// Number of the record that comes next.
  std::int64_t next_record() const { return next_record_; }
  /// Drops the first n events.
  void drop(std::size_t n);
  /// How many events were dropped since the last restart().
  std::int64_t dropped() const { return dropped_; }
  /// The number of the present start, from 1.
  std::int64_t start() const { return start_; }

  double horizon() const { return horizon_; }
  const EventCounts& counts() const { return counts_; }
  /// Of all starts.
  const std::vector<DegradedInterval>& degraded() const { return degraded_; }

 private:
  void make_up(ContactSet closed, double t);
  bool skip(Skip cause, const ContactEvent& event, double missing_from);
  void append(const ContactEvent& event);

  int contacts_;
  std::vector<ContactEvent> events_;
  std::int64_t next_record_ = 0;
  ContactSet chi_ = 0;  // after the last event
  double last_t_ = 0.0;
  double horizon_ = 0.0;
  std::array<double, max_contacts> last_of_{};  // time of each contact's last event
  double complete_to_ = std::numeric_limits<double>::infinity();
  std::int64_t start_ = 0;
  std::int64_t dropped_ = 0;
  std::array<ContactEvent, skips> last_skipped_{};
  EventCounts counts_;
  std::vector<DegradedInterval> degraded_;
};

}  // namespace sprag
