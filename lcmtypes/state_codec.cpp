#include "lcmtypes/state_codec.h"

#include <cmath>
#include <sprag/estimate_t.hpp>
#include <sprag/state_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

namespace {

constexpr std::size_t head_size = 5 * 8 + 4;  // type hash, session, utime, tick, t, f

/// Bytes of a message with this number of entries of q and u together.
std::size_t state_size(std::size_t entries) { return head_size + 8 * entries + 8; }
// The parts of an estimate that follow the state. settled_size: settled_tick, estimators,
// from_filter, bound, deviations. Then the standard deviations, gaps and their standard deviations.
// last_size: closing .. suspicion.
constexpr std::size_t settled_size = 8 + 1 + 1 + 8 + 4;
constexpr std::size_t last_size = 8 + 4 + 3 * 8 + 8 + 8 + 4 + 1;
std::size_t estimate_size(std::size_t entries, std::size_t deviations, std::size_t gaps) {
  return state_size(entries) + settled_size + 16 * deviations + 4 + 8 * gaps + last_size;
}

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

/// The number of entries that is stored at `offset` of the message.
std::int32_t count_at(std::span<const std::uint8_t> message, std::size_t offset) {
  const std::uint8_t* from = message.data() + offset;
  return take<std::int32_t>(from);
}

/// Checks the type of the message and its f, which is stored in `coordinates`.
Refusal check_head(std::span<const std::uint8_t> message, std::int64_t hash,
                   std::size_t& coordinates) {
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != hash) return Refusal::wrong_type;
  if (message.size() < head_size) return Refusal::truncated;
  const std::int32_t f = count_at(message, head_size - sizeof(std::int32_t));
  if (f < 1) return Refusal::bad_count;
  coordinates = static_cast<std::size_t>(f);
  return Refusal::none;
}

Refusal check_size(std::span<const std::uint8_t> message, std::size_t size) {
  if (message.size() < size) return Refusal::truncated;
  return message.size() > size ? Refusal::oversized : Refusal::none;
}

/// Checks the lengths of an estimate against its own counts before anything is stored.
Refusal check_estimate(std::span<const std::uint8_t> message) {
  std::size_t f = 0;
  const Refusal refusal = check_head(message, estimate_t::getHash(), f);
  if (refusal != Refusal::none) return refusal;
  std::size_t known = state_size(2 * f) + settled_size;
  if (message.size() < known) return Refusal::truncated;
  const std::int32_t deviations = count_at(message, known - sizeof(std::int32_t));
  if (deviations != 0 && (deviations < 0 || static_cast<std::size_t>(deviations) != f)) {
    return Refusal::bad_count;
  }
  known += 16 * static_cast<std::size_t>(deviations) + sizeof(std::int32_t);
  if (message.size() < known) return Refusal::truncated;
  const std::int32_t gaps = count_at(message, known - sizeof(std::int32_t));
  if (gaps < 0 || gaps > max_contacts) return Refusal::bad_count;
  return check_size(message, estimate_size(2 * f, static_cast<std::size_t>(deviations),
                                           static_cast<std::size_t>(gaps)));
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

void put_all(std::uint8_t*& to, const Eigen::VectorXd& values) {
  for (const double value : values) put(to, value);
}

void take_all(const std::uint8_t*& from, std::int32_t count, Eigen::VectorXd& values) {
  values.resize(count);
  for (double& value : values) value = take<double>(from);
}

// Contacts count from 1 in messages; 0: none.
std::int32_t number_of(int contact, double t) { return t < 0.0 ? 0 : contact + 1; }
int contact_of(std::int32_t number) { return number > 0 ? number - 1 : 0; }

void put_confidence(const Confidence& confidence, std::uint8_t*& to) {
  put(to,
      static_cast<std::int8_t>((confidence.has_replica ? 1 : 0) + (confidence.has_filter ? 2 : 0)));
  put(to, static_cast<std::int8_t>(confidence.from_filter ? 1 : 0));
  put(to, confidence.bound);
  put(to, static_cast<std::int32_t>(confidence.sigma_q.size()));
  put_all(to, confidence.sigma_q);
  put_all(to, confidence.sigma_u);
  put(to, static_cast<std::int32_t>(confidence.sigma_g.size()));
  put_all(to, confidence.sigma_g);
  const Innovation& closing = confidence.has_replica ? confidence.replica : confidence.filter;
  put(to, closing.t);
  put(to, number_of(closing.contact, closing.t));
  put(to, confidence.replica.gap);
  put(to, confidence.filter.gap);
  put(to, confidence.filter.deviation);
  put(to, confidence.inconsistencies);
  put(to, confidence.last.t);
  put(to, number_of(confidence.last.contact, confidence.last.t));
  put(to, static_cast<std::int8_t>(confidence.last.suspicion));
}

Refusal take_confidence(const std::uint8_t*& from, Confidence& confidence) {
  const auto estimators = take<std::int8_t>(from);
  const auto from_filter = take<std::int8_t>(from);
  confidence.has_replica = (estimators & 1) != 0;
  confidence.has_filter = (estimators & 2) != 0;
  confidence.from_filter = from_filter == 1;
  confidence.bound = take<double>(from);
  const auto deviations = take<std::int32_t>(from);
  take_all(from, deviations, confidence.sigma_q);
  take_all(from, deviations, confidence.sigma_u);
  const auto gaps = take<std::int32_t>(from);
  take_all(from, gaps, confidence.sigma_g);
  const auto t = take<double>(from);
  const auto contact = take<std::int32_t>(from);
  confidence.replica = {t, contact_of(contact), take<double>(from), 0.0};
  confidence.filter = {t, contact_of(contact), take<double>(from), take<double>(from)};
  confidence.inconsistencies = take<std::int64_t>(from);
  confidence.last.t = take<double>(from);
  const auto suspect = take<std::int32_t>(from);
  confidence.last.contact = contact_of(suspect);
  const auto suspicion = take<std::int8_t>(from);
  confidence.last.suspicion = static_cast<Suspicion>(suspicion);

  // Standard deviations and the bound are infinite where unknown, so this does not require finite
  // values.
  const auto not_negative = [](const Eigen::VectorXd& values) {
    return (values.array() >= 0.0).all();
  };
  const bool possible =
      estimators >= 0 && estimators <= 3 && (from_filter == 0 || from_filter == 1) &&
      confidence.bound >= 0.0 && not_negative(confidence.sigma_q) &&
      not_negative(confidence.sigma_u) && not_negative(confidence.sigma_g) && std::isfinite(t) &&
      contact >= 0 && contact <= max_contacts && std::isfinite(confidence.replica.gap) &&
      std::isfinite(confidence.filter.gap) && !std::isnan(confidence.filter.deviation) &&
      confidence.inconsistencies >= 0 && std::isfinite(confidence.last.t) && suspect >= 0 &&
      suspect <= max_contacts && suspicion >= 0 && suspicion <= 3;
  return possible ? Refusal::none : Refusal::bad_value;
}

}  // namespace

std::span<const std::uint8_t> encode(const StateSample& sample, std::vector<std::uint8_t>& buffer) {
  buffer.resize(state_size(entries(sample)));
  put_state(sample, state_t::getHash(), buffer.data());
  return buffer;
}

std::span<const std::uint8_t> encode(const EstimateSample& sample,
                                     std::vector<std::uint8_t>& buffer) {
  const Confidence& confidence = sample.confidence;
  buffer.resize(estimate_size(entries(sample), static_cast<std::size_t>(confidence.sigma_q.size()),
                              static_cast<std::size_t>(confidence.sigma_g.size())));
  std::uint8_t* to = put_state(sample, estimate_t::getHash(), buffer.data());
  put(to, sample.settled_tick);
  put_confidence(confidence, to);
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, StateSample& sample) {
  std::size_t f = 0;
  Refusal refusal = check_head(message, state_t::getHash(), f);
  if (refusal == Refusal::none) refusal = check_size(message, state_size(2 * f));
  const std::uint8_t* from = message.data();
  return refusal != Refusal::none ? refusal : take_state(from, sample);
}

Refusal decode(std::span<const std::uint8_t> message, EstimateSample& sample) {
  Refusal refusal = check_estimate(message);
  if (refusal != Refusal::none) return refusal;
  const std::uint8_t* from = message.data();
  refusal = take_state(from, sample);
  if (refusal != Refusal::none) return refusal;
  sample.settled_tick = take<std::int64_t>(from);
  if (sample.settled_tick < -1) return Refusal::bad_time;
  return take_confidence(from, sample.confidence);
}

}  // namespace sprag
