// What is refused, skipped or lost is told at once: a line for each cause, with the first case
// since the last line, at most once a second. Any thread may raise a notice without a lock or
// allocation, each cause from one thread only; one thread tells them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <iosfwd>

#include "recording/continuity.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/event_history.h"

namespace sprag {

/// The comments say what the two values that go with them are.
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
  backwards,        ///< time [s] and contact of the event, for these four
  beyond_horizon,
  unknown_contact,
  contradicting,
  gap,      ///< from, to [s]
  resumed,  ///< from, to [s]: horizons
};

inline constexpr std::size_t notice_kinds = 25;

class Notices {
 public:
  /// Counts `times` cases; of the first since the cause was last told, the values are kept.
  void raise(Notice notice, std::int64_t times = 1, double first = 0.0,
             double second = 0.0) noexcept {
    Cause& cause = causes_[static_cast<std::size_t>(notice)];
    const std::int64_t raised = cause.raised.load(std::memory_order_relaxed);
    // The telling thread reads the values only while there is something to tell.
    if (cause.told.load(std::memory_order_acquire) == raised) {
      cause.first = first;
      cause.second = second;
    }
    cause.raised.store(raised + times, std::memory_order_release);
  }

  /// Tells what has not been told, except causes of which there was a line within the last second.
  /// `now`: monotonic [ns].
  void tell(std::int64_t now, std::ostream& out);

  /// The same without regard to the time: nothing follows.
  void tell_rest(std::ostream& out);

 private:
  struct Cause {
    std::atomic<std::int64_t> raised{0};
    std::atomic<std::int64_t> told{0};
    double first = 0.0, second = 0.0;
    std::int64_t next_line = 0;  // monotonic [ns]
  };

  static void tell(Notice notice, Cause& cause, std::ostream& out);

  std::array<Cause, notice_kinds> causes_;
};

/// Raises what a history has skipped or lost since its counts were `before`.
void raise_skipped(const EventHistory& history, const EventCounts& before,
                   Notices& notices) noexcept;

/// Raises what did not fit in a message, if anything; `horizon`: the observer's [s].
void raise_odd(Oddity oddity, const ContactMessage& message, double horizon,
               Notices& notices) noexcept;

}  // namespace sprag
