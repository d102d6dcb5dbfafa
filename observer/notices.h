// Messages on stderr about refused, skipped or lost data: one line per cause with its first case
// since the last line, at most one per second. Any thread may raise a notice without a lock or
// allocation, but each cause from one thread only. One thread prints them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <iosfwd>

#include "recording/session_tracker.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/event_history.h"

namespace sprag {

/// Causes. The comments give the meaning of the two values of a case.
enum class Notice {
  unauthenticated,  ///< none
  malformed,        ///< none
  fragment,         ///< none
  other_host,       ///< none
  wrong_type,       ///< none
  wrong_size,       ///< none
  bad_count,        ///< none
  bad_contact,      ///< none
  bad_kind,         ///< none
  bad_closed,       ///< none
  bad_time,         ///< none
  bad_speed,        ///< none
  other_machine,    ///< its number of contacts, ours
  crowded,          ///< none
  stale,            ///< age [s]
  odd_time,         ///< its horizon [s], the observer's
  odd_speed,        ///< its speed
  odd_number,       ///< its message number
  odd_records,      ///< its number of records
  backwards,        ///< time [s] and contact, from 1, of the event; also for the next three
  beyond_horizon,
  unknown_contact,
  contradicting,
  gap,        ///< from, to [s]
  resumed,    ///< from, to [s]: watermarks
  bad_input,  ///< none
};

inline constexpr std::size_t notice_kinds = 26;

class Notices {
 public:
  /// Counts `times` cases. The values are kept only for the first case since the last line of this
  /// cause.
  void raise(Notice notice, std::int64_t times = 1, double first = 0.0,
             double second = 0.0) noexcept {
    Cause& cause = causes_[static_cast<std::size_t>(notice)];
    const std::int64_t raised = cause.raised.load(std::memory_order_relaxed);
    // The printing thread reads the values only while raised > reported.
    if (cause.reported.load(std::memory_order_acquire) == raised) {
      cause.first = first;
      cause.second = second;
    }
    cause.raised.store(raised + times, std::memory_order_release);
  }

  /// Prints the cases since the last line, except of causes with a line within the last second.
  /// `now`: monotonic [ns].
  void print(std::int64_t now, std::ostream& out);

  /// Prints all remaining cases, at the end of a run.
  void print_rest(std::ostream& out);

 private:
  struct Cause {
    std::atomic<std::int64_t> raised{0};
    std::atomic<std::int64_t> reported{0};
    double first = 0.0, second = 0.0;
    std::int64_t next_line = 0;  // monotonic [ns]
  };

  static void print(Notice notice, Cause& cause, std::ostream& out);

  std::array<Cause, notice_kinds> causes_;
};

/// Raises notices about events that a history has skipped or lost since its counts were `before`.
void raise_skipped(const EventHistory& history, const EventCounts& before,
                   Notices& notices) noexcept;

/// Raises a notice about an inconsistent message, if any; `horizon`: the observer's watermark [s].
void raise_odd(Oddity oddity, const ContactMessage& message, double horizon,
               Notices& notices) noexcept;

}  // namespace sprag
