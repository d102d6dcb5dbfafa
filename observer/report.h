// Event and rollback counts as JSON, for --report.
#pragma once

#include <nlohmann/json.hpp>

#include "sprag/detail/live/time_line.h"

namespace sprag {

inline nlohmann::ordered_json to_json(const EventHistory& history) {
  const EventCounts& counts = history.counts();
  nlohmann::ordered_json degraded = nlohmann::ordered_json::array();
  for (const DegradedInterval& interval : history.degraded()) {
    degraded.push_back({{"from", interval.from}, {"to", interval.to}, {"start", interval.start}});
  }
  return {{"events", counts.events},
          {"made_up_events", counts.made_up},
          {"lost_records", counts.lost_records},
          {"degraded", degraded},
          {"skipped",
           {{"backwards", counts.of(Skip::backwards)},
            {"beyond_horizon", counts.of(Skip::beyond_horizon)},
            {"unknown_contact", counts.of(Skip::unknown_contact)},
            {"contradicting", counts.of(Skip::contradicting)}}}};
}

inline nlohmann::ordered_json to_json(const RollbackCounts& counts) {
  return {{"count", counts.rollbacks},
          {"deepest_ticks", counts.depth.largest()},
          {"ticks_redone", counts.ticks_redone},
          {"beyond_history", counts.beyond_history}};
}

}  // namespace sprag
