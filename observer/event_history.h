// The contact events an observer believes in: what its master's reports add up to. Reports may be
// lost, doubled or reordered; every one repeats the last records, and records are numbered, so that
// each is taken once and a gap is seen. Knows nothing of ticks, clocks or transport.
#pragma once

#include <cstdint>
#include <vector>

#include "mechanics/contact_event.h"
#include "mechanics/contact_report.h"

namespace sprag {

inline constexpr double no_horizon = -1.0;

/// Simulated times between which events may be missing.
struct DegradedInterval {
  double from = 0.0;
  double to = 0.0;
};

struct EventCounts {
  std::int64_t events = 0;           ///< taken, made up ones included
  std::int64_t made_up = 0;          ///< so that chi follows a report after a gap
  std::int64_t lost_records = 0;     ///< never seen: the gap was longer than a report's repeats
  std::int64_t backwards = 0;        ///< skipped: earlier than the record before, or than a horizon
  std::int64_t beyond_horizon = 0;   ///< skipped: later than its own report's horizon
  std::int64_t unknown_contact = 0;  ///< skipped
  /// Skipped: closes or pulses while closed, opens while open.
  std::int64_t contradicting = 0;
};

class EventHistory {
 public:
  /// For a machine with m contacts. Room for `capacity` events at a time; no allocation while they
  /// suffice.
  EventHistory(int contacts, std::size_t capacity);

  /// Forgets everything: the first record to come is number `next_record`, chi before it is `chi`,
  /// every event up to `horizon` is known (nothing yet: `no_horizon`).
  void restart(std::int64_t next_record, ContactSet chi, double horizon);

  /// Takes what is new in a report of the present session; returns how many events were appended.
  /// After a gap chi follows the report's `closed`: what the lost records did is made up where the
  /// gap ends.
  std::size_t add(const ContactReport& report);

  /// Takes one event from a file; false if it was skipped.
  bool add(const ContactEvent& event);

  /// Declares that every event up to t is known; never goes back.
  void set_horizon(double t);

  const std::vector<ContactEvent>& events() const { return events_; }
  /// Drops the first n events.
  void drop(std::size_t n);

  double horizon() const { return horizon_; }
  const EventCounts& counts() const { return counts_; }
  const std::vector<DegradedInterval>& degraded() const { return degraded_; }

 private:
  void make_up(ContactSet closed, double t);

  int contacts_;
  std::vector<ContactEvent> events_;
  std::int64_t next_record_ = 0;
  ContactSet chi_ = 0;  // after the last event
  double last_t_ = 0.0;
  double horizon_ = 0.0;
  EventCounts counts_;
  std::vector<DegradedInterval> degraded_;
};

}  // namespace sprag
