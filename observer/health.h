// The status of the integrating thread once a second, and its conversion to the observer's health
// message.
#pragma once

#include <cstdint>

#include "lcmtypes/messages.h"
#include "observer/figures.h"
#include "sprag/confidence.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/live/histogram.h"

namespace sprag {

inline constexpr std::int64_t health_period = 1'000'000'000;  // ns

/// Status of the integrating thread. Copying does not allocate. Wall-clock times in ns.
struct IntegrationStatus {
  bool last = false;  ///< the thread has ended
  MasterState master = MasterState::awaited;
  InputState input = InputState::none;
  std::int64_t session = 0;
  std::int64_t tick = -1;  ///< last estimated tick
  double t = -1.0;         ///< its time [s]
  double speed = 0.0;      ///< of the master: simulated s per s

  // Since the previous status.
  std::int64_t period = 0;
  double simulated = 0.0;  ///< simulated time estimated for the first time [s]
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

  /// Resets the figures of the period.
  void begin_period() {
    period = 0;
    simulated = 0.0;
    event_latency = lateness = Histogram{};
  }
};

/// The fields of the health message that follow from these two.
health_t health_of(const IntegrationStatus& status, const ReceptionFigures& reception);

/// The source of an estimate with this confidence.
EstimateSource source_of(const Confidence& confidence);

}  // namespace sprag
