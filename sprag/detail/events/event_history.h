// Merges the messages of a master into one list of contact events. Messages may be lost, duplicated
// or reordered. Each repeats the last records, and records are numbered, so that each is taken once
// and a gap is detected. Independent of ticks, clocks and transport.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

inline constexpr double no_horizon = -1.0;

/// Events of one machine in order of time. An event is skipped if it is
///  - earlier than the event before it, or not after the horizon (`backwards`);
///  - later than its own message's horizon (`beyond_horizon`);
///  - of a contact that the machine does not have (`unknown_contact`);
///  - a closing or a pulse of a closed contact, or an opening of an open one (`contradicting`).
/// A skipped event starts a degraded interval, because the estimate does not include it.
class EventHistory {
 public:
  /// For a machine with m contacts. Reserves room for `capacity` events at a time and does not
  /// allocate while that suffices.
  EventHistory(int contacts, std::size_t capacity);

  /// Clears the history. The next record has the number `next_record`, chi before it is `chi`, and
  /// every event up to `horizon` is known (`no_horizon`: none).
  void restart(std::int64_t next_record, ContactSet chi, double horizon);

  /// Takes the new records of a message of the present session. Returns the number of appended
  /// events. At the end of a gap it inserts events that make chi agree with the message's `closed`.
  std::size_t add(const ContactMessage& message);

  /// Takes one event of a file. Returns false if it was skipped.
  bool add(const ContactEvent& event);

  /// Sets the horizon: every event up to t is known. It never decreases.
  void set_horizon(double t);

  const std::vector<ContactEvent>& events() const { return events_; }
  /// Last event that was skipped for this cause.
  const ContactEvent& last_skipped(Skip cause) const {
    return last_skipped_[static_cast<std::size_t>(cause)];
  }

  /// Counts the records before a message as lost without taking any. restart() must follow.
  void lose(const ContactMessage& message);

  /// Adds a degraded interval from `from`, or from the horizon if that is later, up to `to`.
  void degrade(double from, double to);

  /// Whether a degraded interval of this start contains t, or ended at most `events` events before
  /// t.
  bool lost_before(double t, std::size_t events) const;

  /// Number of the next record.
  std::int64_t next_record() const { return next_record_; }
  /// Drops the first n events.
  void drop(std::size_t n);
  /// Number of events dropped since the last restart().
  std::int64_t dropped() const { return dropped_; }
  /// The number of the present start, from 1.
  std::int64_t start() const { return start_; }

  double horizon() const { return horizon_; }
  const EventCounts& counts() const { return counts_; }
  /// Degraded intervals of all starts.
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
  std::int64_t start_ = 0;
  std::int64_t dropped_ = 0;
  std::array<ContactEvent, skips> last_skipped_{};
  EventCounts counts_;
  std::vector<DegradedInterval> degraded_;
};

}  // namespace sprag
