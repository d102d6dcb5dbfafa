// Health <-> sprag_health_t (SPRAG_HEALTH): how a live observer fares.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/refusal.h"

namespace sprag {

/// Messages that were refused for one cause.
struct RefusedCount {
  std::string cause;  ///< as in --report
  std::int64_t count = 0;

  bool operator==(const RefusedCount&) const = default;
};

struct Health {
  enum class Master : std::int8_t {
    awaited = 0,  ///< none has been heard
    heard = 1,
    silent = 2,  ///< the estimate runs free
    ended = 3    ///< its run is over; the estimate runs free
  };
  enum class Estimate : std::int8_t { none = 0, replica = 1, filter = 2, adaptive = 3 };

  /// From values of a histogram [s].
  struct Times {
    double p50 = 0.0, p99 = 0.0, max = 0.0;
  };

  std::int64_t session = 0;  ///< the master's; 0: none yet
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = -1;    ///< the last one that was estimated; -1: none yet
  double t = -1.0;           ///< its simulated time [s]; -1: none yet
  bool last = false;         ///< the observer's last word
  Master master = Master::awaited;
  Estimate estimate = Estimate::none;

  // Of the time since the health before.
  double period = 0.0;            ///< by the wall [s]
  double real_time_factor = 0.0;  ///< simulated time that was estimated per wall time
  double speed = 0.0;             ///< what it should be, +infinity of an unpaced master; 0: none
  std::int64_t latencies = 0;     ///< events whose latency was taken
  Times latency;                  ///< from an event's own time to the estimate that contains it
  Times lateness;                 ///< of ticks, from when they were due

  // Since the observer's start; lcmtypes/sprag_health_t.lcm says what they count.
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

/// The health as a message. It lies in `buffer` and is valid until the buffer is used again.
/// Expects what decode() accepts.
std::span<const std::uint8_t> encode(const Health& health, std::vector<std::uint8_t>& buffer);

/// Fills `health` from a message and returns Refusal::none, or why the message is refused; `health`
/// then holds nothing of use. Accepted: tick >= -1, t finite and >= 0, or -1; times and rates >= 0
/// and finite (but the speed may be infinite), counts >= 0; at most 64 causes, each of 1 to 63
/// printable ASCII characters.
Refusal decode(std::span<const std::uint8_t> message, Health& health);

}  // namespace sprag
