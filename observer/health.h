// What the integrating thread says of itself once a second, and what becomes of it: the observer's
// health (lcmtypes/health_codec.h).
#pragma once

#include <cstdint>

#include "lcmtypes/health_codec.h"
#include "lcmtypes/state_codec.h"
#include "observer/figures.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/live/histogram.h"

namespace sprag {

inline constexpr std::int64_t health_period = 1'000'000'000;  // ns

/// By the integrating thread. Copies allocate nothing. Wall-clock times in ns.
struct IntegrationStatus {
  bool last = false;  ///< the thread is at its end
  Health::Master master = Health::Master::awaited;
  std::int64_t session = 0;
  std::int64_t tick = -1;  ///< the last one that was estimated
  double t = -1.0;         ///< of it [s]
  double speed = 0.0;      ///< the master's: simulated s per s

  // Since the status before.
  std::int64_t period = 0;
  double simulated = 0.0;  ///< that was estimated for the first time [s]
  Histogram event_latency;
  Histogram lateness;

  // Since the start.
  std::int64_t deadlines = 0;
  std::int64_t missed = 0;
  std::int64_t real_time_losses = 0;
  std::int64_t late_events = 0;
  std::int64_t gaps = 0;
  std::int64_t rollbacks = 0;
  EventCounts events;
  MessageCounts messages;

  /// Begins the time after this status.
  void begin_period() {
    period = 0;
    simulated = 0.0;
    event_latency = lateness = Histogram{};
  }
};

/// All of the health that these two know.
Health health_of(const IntegrationStatus& status, const ReceptionFigures& reception);

/// Whose estimate it is that has this confidence.
Health::Estimate whose(const Confidence& confidence);

}  // namespace sprag
