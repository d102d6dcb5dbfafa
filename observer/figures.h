// What a live observer counts on its way, for the report and the last words on stderr.
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>

#include "lcmtypes/bus.h"
#include "lcmtypes/refusal.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/live/histogram.h"
#include "sprag/detail/live/time_line.h"

namespace sprag {

/// By the integrating thread. Times in wall-clock ns.
struct IntegrationFigures {
  Histogram lateness;       ///< of ticks with a deadline, from when they were due
  std::int64_t missed = 0;  ///< of them, later than the next tick was due
  Histogram execution;      ///< a turn of the loop: messages, rollbacks, ticks
  Histogram event_latency;  ///< from an event's own time to the estimate that contains it
  Histogram rollback_cost;  ///< turns that went back
  std::int64_t real_time_losses = 0;
  std::int64_t real_time_lost = 0;   ///< in all
  std::int64_t repaired_events = 0;  ///< that came by the repeats behind a lost message
  /// Older than the estimate for now when they came. Nothing is amiss with that: a report follows
  /// its event, and the estimate has gone on meanwhile.
  std::int64_t late_events = 0;
  std::int64_t estimates_dropped = 0;
  std::int64_t unsettled_ticks = 0;  ///< at the end
};

/// By the receiving thread.
struct ReceptionFigures {
  std::array<std::int64_t, refusal_kinds> refused{};
  std::int64_t other_machine = 0;  ///< another number of contacts
  std::int64_t overflowed = 0;     ///< the integrating thread had no room
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

/// Events that came later than is usual in this run.
struct DelayedEvents {
  std::int64_t after = 0;  ///< an event with more latency than this is delayed [ns]
  std::int64_t count = 0;
};

/// The limit is 4 times the median latency, but not less than 10 ms, a heartbeat of the master.
DelayedEvents delayed(const Histogram& event_latency);

/// Messages that were refused, by cause, as in the report.
nlohmann::ordered_json refused_by_cause(const ReceptionFigures& reception,
                                        const MessageCounts& messages);

/// Adds to the report.
void write_json(const LiveFigures& figures, nlohmann::ordered_json& report);

/// A few lines for people.
void print(const LiveFigures& figures, std::ostream& out);

}  // namespace sprag
