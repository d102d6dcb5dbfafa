#include "lcmtypes/health_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sprag/health_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {
namespace {

// In the order of the message.
constexpr std::array health_counts{&Health::sessions,
                                   &Health::ticks,
                                   &Health::deadlines,
                                   &Health::missed_deadlines,
                                   &Health::real_time_losses,
                                   &Health::events,
                                   &Health::late_events,
                                   &Health::lost_events,
                                   &Health::gaps,
                                   &Health::skipped_events,
                                   &Health::rollbacks,
                                   &Health::inconsistencies,
                                   &Health::messages,
                                   &Health::lost_messages,
                                   &Health::doubled_messages,
                                   &Health::reordered_messages,
                                   &Health::other_masters,
                                   &Health::stale,
                                   &Health::overflowed,
                                   &Health::unsent};
// Type hash, session, utime, tick, t; four flags; three rates, a count, six times; the counts; the
// number of causes.
constexpr std::size_t fixed_size = 5 * 8 + 4 + 10 * 8 + 8 * health_counts.size() + 4;

constexpr std::int32_t most_causes = 64;
constexpr std::int32_t longest_cause = 64;  // including the final zero

void put_times(std::uint8_t*& to, const Health::Times& times) {
  put(to, times.p50);
  put(to, times.p99);
  put(to, times.max);
}

Health::Times take_times(const std::uint8_t*& from) {
  Health::Times times;
  times.p50 = take<double>(from);
  times.p99 = take<double>(from);
  times.max = take<double>(from);
  return times;
}

bool possible(double duration) { return std::isfinite(duration) && duration >= 0.0; }
bool possible(const Health::Times& times) {
  return possible(times.p50) && possible(times.p99) && possible(times.max);
}

// Reads the causes and their counts, which follow the fixed part; `rest` is the rest of the
// message.
Refusal take_causes(std::span<const std::uint8_t> rest, std::int32_t causes, Health& health) {
  health.refused.resize(static_cast<std::size_t>(causes));
  for (RefusedCount& refused : health.refused) {
    if (rest.size() < 4) return Refusal::truncated;
    const std::uint8_t* from = rest.data();
    const auto size = take<std::int32_t>(from);
    if (size < 2 || size > longest_cause) return Refusal::bad_count;
    const auto length = static_cast<std::size_t>(size) - 1;
    if (rest.size() < 4 + length + 1) return Refusal::truncated;
    const auto printable = [](std::uint8_t c) { return c >= 0x20 && c < 0x7f; };
    if (!std::all_of(from, from + length, printable) || from[length] != 0) {
      return Refusal::bad_value;
    }
    refused.cause.assign(from, from + length);
    rest = rest.subspan(4 + length + 1);
  }
  const std::size_t size = 8 * health.refused.size();
  if (rest.size() != size) return rest.size() < size ? Refusal::truncated : Refusal::oversized;
  const std::uint8_t* from = rest.data();
  for (RefusedCount& refused : health.refused) {
    refused.count = take<std::int64_t>(from);
    if (refused.count < 0) return Refusal::bad_count;
  }
  return Refusal::none;
}

}  // namespace

std::span<const std::uint8_t> encode(const Health& health, std::vector<std::uint8_t>& buffer) {
  std::size_t size = fixed_size + 8 * health.refused.size();
  for (const RefusedCount& refused : health.refused) size += text_size(refused.cause);
  buffer.resize(size);
  std::uint8_t* to = buffer.data();
  put(to, health_t::getHash());
  put(to, health.session);
  put(to, health.utime);
  put(to, health.tick);
  put(to, health.t);
  put(to, static_cast<std::int8_t>(health.last ? 1 : 0));
  put(to, static_cast<std::int8_t>(health.master));
  put(to, static_cast<std::int8_t>(health.estimate));
  put(to, static_cast<std::int8_t>(health.input));
  put(to, health.period);
  put(to, health.real_time_factor);
  put(to, health.speed);
  put(to, health.latencies);
  put_times(to, health.latency);
  put_times(to, health.lateness);
  for (const auto count : health_counts) put(to, health.*count);
  put(to, static_cast<std::int32_t>(health.refused.size()));
  for (const RefusedCount& refused : health.refused) put_text(to, refused.cause);
  for (const RefusedCount& refused : health.refused) put(to, refused.count);
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, Health& health) {
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != health_t::getHash()) return Refusal::wrong_type;
  if (message.size() < fixed_size) return Refusal::truncated;
  health.session = take<std::int64_t>(from);
  health.utime = take<std::int64_t>(from);
  health.tick = take<std::int64_t>(from);
  health.t = take<double>(from);
  const auto last = take<std::int8_t>(from);
  const auto master = take<std::int8_t>(from);
  const auto estimate = take<std::int8_t>(from);
  const auto input = take<std::int8_t>(from);
  health.last = last == 1;
  health.master = static_cast<Health::Master>(master);
  health.estimate = static_cast<Health::Estimate>(estimate);
  health.input = static_cast<Health::Input>(input);
  health.period = take<double>(from);
  health.real_time_factor = take<double>(from);
  health.speed = take<double>(from);
  health.latencies = take<std::int64_t>(from);
  health.latency = take_times(from);
  health.lateness = take_times(from);
  bool countable = health.latencies >= 0;
  for (const auto count : health_counts) {
    health.*count = take<std::int64_t>(from);
    countable = countable && health.*count >= 0;
  }
  const auto causes = take<std::int32_t>(from);
  if (health.tick < -1 || (health.t != -1.0 && !possible(health.t))) return Refusal::bad_time;
  if (!possible(health.period) || !possible(health.latency) || !possible(health.lateness)) {
    return Refusal::bad_time;
  }
  if (!possible(health.real_time_factor) || !(health.speed >= 0.0)) return Refusal::bad_speed;
  if (last < 0 || last > 1 || master < 0 || master > 3 || estimate < 0 || estimate > 3 ||
      input < 0 || input > 2) {
    return Refusal::bad_value;
  }
  if (!countable || causes < 0 || causes > most_causes) return Refusal::bad_count;
  return take_causes(message.subspan(fixed_size), causes, health);
}

}  // namespace sprag
