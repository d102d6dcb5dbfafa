// Counts and times of a live observer, for the report and the summary on stderr.
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <numeric>

#include "lcmtypes/bus.h"
#include "lcmtypes/refusal.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/live/histogram.h"
#include "sprag/detail/live/time_line.h"

namespace sprag {

/// Figures of the integrating thread. Times in wall-clock ns.
struct IntegrationFigures {
  Histogram lateness;       ///< of ticks with a deadline, relative to their due times
  std::int64_t missed = 0;  ///< of these, those finished after the next tick was due
  Histogram execution;      ///< of one turn of the loop: messages, rollbacks, ticks
  Histogram event_latency;  ///< from an event's time to the first estimate that contains it
  Histogram rollback_cost;  ///< duration of turns with a rollback
  std::int64_t real_time_losses = 0;
  std::int64_t real_time_lost = 0;   ///< total
  std::int64_t repaired_events = 0;  ///< received by repetition after a lost message
  /// Events that were older at arrival than the provisional estimate. This is normal: a report
  /// follows its event, and the estimate advances meanwhile.
  std::int64_t late_events = 0;
  std::int64_t estimates_dropped = 0;
  std::int64_t unsettled_ticks = 0;  ///< at the end
};

/// Figures of the receiving thread.
struct ReceptionFigures {
  std::array<std::int64_t, refusal_kinds> refused{};
  std::int64_t other_machine = 0;  ///< messages with another number of contacts
  std::int64_t overflowed = 0;     ///< messages for which a queue was full
  BusCounts bus;

  bool operator==(const ReceptionFigures&) const = default;
};

struct LiveFigures {
  IntegrationFigures integration;
  ReceptionFigures reception;
  MessageCounts messages;
  RollbackCounts rollbacks;
  EventCounts events;
  std::int64_t ticks = 0;   ///< settled and published
  std::int64_t unsent = 0;  ///< estimates that could not be sent
};

/// Number of events that were skipped, for any cause.
inline std::int64_t all_skipped(const EventCounts& counts) {
  return std::accumulate(counts.skipped.begin(), counts.skipped.end(), std::int64_t{0});
}

/// Events with an unusual latency.
struct DelayedEvents {
  std::int64_t after = 0;  ///< limit of the latency [ns]
  std::int64_t count = 0;
};

/// The limit is 4 times the median latency, but not less than 10 ms, a heartbeat of the master.
DelayedEvents delayed(const Histogram& event_latency);

/// Counts of refused messages by cause, as in the report.
nlohmann::ordered_json refused_by_cause(const ReceptionFigures& reception,
                                        const MessageCounts& messages);

/// Adds the figures to a report.
void write_json(const LiveFigures& figures, nlohmann::ordered_json& report);

/// Prints a summary: one line, or with `verbose` also times and messages.
void print(const LiveFigures& figures, bool verbose, std::ostream& out);

}  // namespace sprag
