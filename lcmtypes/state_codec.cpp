#include "lcmtypes/state_codec.h"

#include <cmath>
#include <sprag/estimate_t.hpp>
#include <sprag/state_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

namespace {

constexpr std::size_t head_size = 5 * 8 + 4;  // type hash, session, utime, tick, t, f

/// Bytes of a message with as many entries in q and u together.
std::size_t state_size(std::size_t entries) { return head_size + 8 * entries + 8; }
std::size_t estimate_size(std::size_t entries) { return state_size(entries) + 8; }

std::size_t entries(const StateSample& sample) {
  return static_cast<std::size_t>(sample.q.size() + sample.u.size());
}

std::uint8_t* put_state(const StateSample& sample, std::int64_t hash, std::uint8_t* to) {
  put(to, hash);
  put(to, sample.session);
  put(to, sample.utime);
  put(to, sample.tick);
  put(to, sample.t);
  put(to, static_cast<std::int32_t>(sample.q.size()));
  for (const double value : sample.q) put(to, value);
  for (const double value : sample.u) put(to, value);
  put(to, sample.closed);
  return to;
}

/// Checks the message's type and its length against its own f before anything is stored.
Refusal check_size(std::span<const std::uint8_t> message, std::int64_t hash,
                   std::size_t (*size_for)(std::size_t)) {
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != hash) return Refusal::wrong_type;
  if (message.size() < head_size) return Refusal::truncated;
  from = message.data() + head_size - sizeof(std::int32_t);
  const auto coordinates = take<std::int32_t>(from);
  if (coordinates < 1) return Refusal::bad_count;
  const std::size_t size = size_for(2 * static_cast<std::size_t>(coordinates));
  if (message.size() < size) return Refusal::truncated;
  return message.size() > size ? Refusal::oversized : Refusal::none;
}

/// Reads a message whose size has been checked.
Refusal take_state(const std::uint8_t*& from, StateSample& sample) {
  from += sizeof(std::int64_t);
  sample.session = take<std::int64_t>(from);
  sample.utime = take<std::int64_t>(from);
  sample.tick = take<std::int64_t>(from);
  sample.t = take<double>(from);
  const Eigen::Index coordinates = take<std::int32_t>(from);
  sample.q.resize(coordinates);
  sample.u.resize(coordinates);
  for (double& value : sample.q) value = take<double>(from);
  for (double& value : sample.u) value = take<double>(from);
  sample.closed = take<ContactSet>(from);
  if (!std::isfinite(sample.t) || sample.t < 0.0 || sample.tick < 0) return Refusal::bad_time;
  if (!sample.q.allFinite() || !sample.u.allFinite()) return Refusal::bad_value;
  if ((sample.closed >> max_contacts) != 0) return Refusal::bad_closed;
  return Refusal::none;
}

}  // namespace

std::span<const std::uint8_t> encode(const StateSample& sample, std::vector<std::uint8_t>& buffer) {
  buffer.resize(state_size(entries(sample)));
  put_state(sample, state_t::getHash(), buffer.data());
  return buffer;
}

std::span<const std::uint8_t> encode(const EstimateSample& sample,
                                     std::vector<std::uint8_t>& buffer) {
  buffer.resize(estimate_size(entries(sample)));
  std::uint8_t* to = put_state(sample, estimate_t::getHash(), buffer.data());
  put(to, sample.settled_tick);
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, StateSample& sample) {
  const Refusal refusal = check_size(message, state_t::getHash(), state_size);
  const std::uint8_t* from = message.data();
  return refusal != Refusal::none ? refusal : take_state(from, sample);
}

Refusal decode(std::span<const std::uint8_t> message, EstimateSample& sample) {
  Refusal refusal = check_size(message, estimate_t::getHash(), estimate_size);
  if (refusal != Refusal::none) return refusal;
  const std::uint8_t* from = message.data();
  refusal = take_state(from, sample);
  if (refusal != Refusal::none) return refusal;
  sample.settled_tick = take<std::int64_t>(from);
  return sample.settled_tick < -1 ? Refusal::bad_time : Refusal::none;
}

}  // namespace sprag
