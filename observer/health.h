// The status of the integrating thread once a second, and the observer's health message.
#pragma once

#include <cstdint>

#include "lcmtypes/messages.h"
#include "observer/figures.h"
#include "sprag/confidence.h"
#include "sprag/detail/live/histogram.h"

namespace sprag {

inline constexpr std::int64_t health_period = 1'000'000'000;  // ns

/// Status of the integrating thread. Copying does not allocate.
struct IntegrationStatus {
  bool last = false;  ///< the thread has ended
  health_t health{};  ///< this thread's fields, except latency, lateness and messages
  MessageCounts messages;

  // Since the previous status.
  double simulated = 0.0;   ///< simulated time estimated for the first time [s]
  Histogram event_latency;  ///< wall clock [ns]
  Histogram lateness;

  IntegrationStatus() {
    health.tick = -1;
    health.t = -1.0;
  }

  /// Resets the figures of the period.
  void begin_period() {
    health.period = health.real_time_factor = simulated = 0.0;
    event_latency = lateness = Histogram{};
  }
};

/// The health message, without the publishing thread's fields.
health_t health_of(const IntegrationStatus& status, const ReceptionFigures& reception);

/// The source of an estimate with this confidence.
EstimateSource source_of(const Confidence& confidence);

}  // namespace sprag
