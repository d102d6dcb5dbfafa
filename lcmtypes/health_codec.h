// Health <-> sprag_health_t (SPRAG_HEALTH): the condition of a live observer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/refusal.h"

namespace sprag {

/// Number of messages refused for one cause.
struct RefusedCount {
  std::string cause;  ///< as in --report
  std::int64_t count = 0;

  bool operator==(const RefusedCount&) const = default;
};

struct Health {
  enum class Master : std::int8_t {
    awaited = 0,   ///< no message has been received
    received = 1,  ///< its messages arrive
    silent = 2,    ///< the estimate is a free prediction
    ended = 3      ///< its run has ended; the estimate is a free prediction
  };
  enum class Input : std::int8_t {
    none = 0,      ///< the excitation is not streamed
    received = 1,  ///< its samples arrive
    silent = 2     ///< no sample for a second; the estimate holds the last one
  };
  enum class Estimate : std::int8_t { none = 0, replica = 1, filter = 2, adaptive = 3 };

  /// Quantiles of a histogram [s].
  struct Times {
    double p50 = 0.0, p99 = 0.0, max = 0.0;
  };

  std::int64_t session = 0;  ///< the master's; 0: none yet
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = -1;    ///< last estimated tick; -1: none
  double t = -1.0;           ///< its simulated time [s]; -1: none
  bool last = false;         ///< the observer's last message
  Master master = Master::awaited;
  Estimate estimate = Estimate::none;
  Input input = Input::none;  ///< the streamed excitation

  // Over the time since the previous message.
  double period = 0.0;            ///< by the wall clock [s]
  double real_time_factor = 0.0;  ///< estimated simulated time per wall time
  double speed = 0.0;             ///< intended factor, +infinity if unpaced; 0: no master
  std::int64_t latencies = 0;     ///< number of events whose latency was measured
  Times latency;                  ///< from an event's time to the first estimate that contains it
  Times lateness;                 ///< of ticks, relative to their due times

  // Since the observer's start; described in lcmtypes/sprag_health_t.lcm.
  std::int64_t sessions = 0;
  std::int64_t ticks = 0;
  std::int64_t deadlines = 0;
  std::int64_t missed_deadlines = 0;
  std::int64_t real_time_losses = 0;
  std::int64_t events = 0;
  std::int64_t late_events = 0;
  std::int64_t lost_events = 0;
  std::int64_t gaps = 0;
  std::int64_t skipped_events = 0;
  std::int64_t rollbacks = 0;
  std::int64_t inconsistencies = 0;
  std::int64_t messages = 0;
  std::int64_t lost_messages = 0;
  std::int64_t doubled_messages = 0;
  std::int64_t reordered_messages = 0;
  std::int64_t other_masters = 0;
  std::int64_t stale = 0;
  std::int64_t overflowed = 0;
  std::int64_t unsent = 0;
  std::vector<RefusedCount> refused;  ///< by cause
};

/// Encodes `health`. The message is in `buffer` and valid until the buffer is changed. Requires
/// values that decode() accepts.
std::span<const std::uint8_t> encode(const Health& health, std::vector<std::uint8_t>& buffer);

/// Reads `health` from a message and returns Refusal::none, or why the message is refused; `health`
/// is unspecified then. Accepted: tick >= -1; t finite and >= 0, or -1; times and rates >= 0 and
/// finite (speed may be infinite); counts >= 0; at most 64 causes, each of 1 to 63 printable ASCII
/// characters.
Refusal decode(std::span<const std::uint8_t> message, Health& health);

}  // namespace sprag
