// Compiled with -fno-strict-aliasing, since LCM's inline functions read and write doubles as
// integers.
#include "lcmtypes/messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <string>
#include <tuple>

#include "lcmtypes/big_endian.h"
#include "sprag/contact_event.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {
namespace {

/// Arrays of one declared length within a type, in wire order: bytes before the length, then for
/// each element a string if `named`, then `bytes` for each element. The rest of a message has a
/// fixed size.
struct Block {
  std::size_t before;
  bool named;
  std::size_t bytes;
};

// The type hash of 8 bytes belongs to the bytes before the first length.
template <class Message>
constexpr std::array<Block, 0> blocks{};
template <>
constexpr std::array<Block, 1> blocks<state_t>{Block{40, false, 16}};
template <>
constexpr std::array<Block, 3> blocks<estimate_t>{
    Block{40, false, 16}, Block{8 + 8 + 2 + 8, false, 16}, Block{0, false, 8}};
template <>
constexpr std::array<Block, 1> blocks<outputs_t>{Block{42, true, 16}};
template <>
constexpr std::array<Block, 1> blocks<parameters_t>{Block{40, true, 16}};
template <>
constexpr std::array<Block, 1> blocks<bounds_t>{Block{56, true, 8}};
template <>
constexpr std::array<Block, 1> blocks<health_t>{Block{5 * 8 + 4 + 30 * 8, true, 8}};

// The generated decode() leaves arrays alone whose declared length is 0.
void clear(contacts_t&) {}
void clear(input_t&) {}
void clear(state_t& m) { m.q.clear(), m.u.clear(); }
void clear(estimate_t& m) {
  for (auto* values : {&m.q, &m.u, &m.sigma_q, &m.sigma_u, &m.sigma_g}) values->clear();
}
void clear(outputs_t& m) { m.name.clear(), m.value.clear(), m.sigma.clear(); }
void clear(parameters_t& m) { m.key.clear(), m.value.clear(), m.sigma.clear(); }
void clear(bounds_t& m) { m.name.clear(), m.half_width.clear(); }
void clear(health_t& m) { m.cause.clear(), m.refused.clear(); }

/// Reads through the declared lengths of a message.
class Lengths {
 public:
  explicit Lengths(std::span<const std::uint8_t> message)
      : rest_(message), most_names_(2 * message.size() / sizeof(std::string)) {}

  Refusal pass(const Block& block) {
    std::int32_t count = 0;
    if (!skip(block.before) || !take_length(count)) return Refusal::truncated;
    if (count < 0) return Refusal::bad_count;
    const auto n = static_cast<std::size_t>(count);
    for (std::size_t i = 0; block.named && i < n; ++i) {
      if (const Refusal refusal = pass_string(); refusal != Refusal::none) return refusal;
    }
    if (!skip(n * block.bytes)) return Refusal::truncated;
    // decode() stores all strings of an array at once; short ones take more room than here.
    return block.named && n > most_names_ ? Refusal::bad_count : Refusal::none;
  }

 private:
  // A string is its length including the final zero, the text, the zero.
  Refusal pass_string() {
    std::int32_t size = 0;
    if (!take_length(size)) return Refusal::truncated;
    if (size < 1) return Refusal::bad_count;
    const std::uint8_t* text = rest_.data();
    if (!skip(static_cast<std::size_t>(size))) return Refusal::truncated;
    return text[size - 1] == 0 ? Refusal::none : Refusal::bad_value;
  }

  bool take_length(std::int32_t& length) {
    if (rest_.size() < sizeof length) return false;
    const std::uint8_t* from = rest_.data();
    length = take<std::int32_t>(from);
    return skip(sizeof length);
  }

  bool skip(std::size_t bytes) {
    if (rest_.size() < bytes) return false;
    rest_ = rest_.subspan(bytes);
    return true;
  }

  std::span<const std::uint8_t> rest_;
  std::size_t most_names_;
};

bool is_number(std::int64_t n) { return n >= 0 && n <= largest_number; }

bool is_duration(double t) { return std::isfinite(t) && t >= 0.0; }

bool all_finite(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double x) { return std::isfinite(x); });
}

// False for nan, true for infinity.
bool none_negative(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double x) { return x >= 0.0; });
}

Refusal check_names(const std::vector<std::string>& names) {
  constexpr std::size_t most = 1000, longest = 255;
  const bool possible =
      names.size() <= most &&
      std::ranges::all_of(names, [](const std::string& name) { return name.size() <= longest; });
  return possible ? Refusal::none : Refusal::bad_count;
}

// Checks the fields that state_t and estimate_t have in common.
template <class Message>
Refusal check_state(const Message& message) {
  if (message.f < 1) return Refusal::bad_count;
  if (!is_duration(message.t) || message.tick < 0) return Refusal::bad_time;
  if (!all_finite(message.q) || !all_finite(message.u)) return Refusal::bad_value;
  if ((static_cast<ContactSet>(message.closed) >> max_contacts) != 0) return Refusal::bad_closed;
  return Refusal::none;
}

// Checks the fields that outputs_t and parameters_t have in common.
template <class Message>
Refusal check_named_values(const Message& message, const std::vector<std::string>& names) {
  if (!is_duration(message.t) || message.tick < 0) return Refusal::bad_time;
  if (const Refusal refusal = check_names(names); refusal != Refusal::none) return refusal;
  return all_finite(message.value) && none_negative(message.sigma) ? Refusal::none
                                                                   : Refusal::bad_value;
}

}  // namespace

Refusal validate(const contacts_t& message) {
  if (!(message.speed > 0.0)) return Refusal::bad_speed;
  if (!is_duration(message.horizon)) return Refusal::bad_time;
  if (message.contacts < 1 || message.contacts > max_contacts) return Refusal::bad_count;
  if ((static_cast<ContactSet>(message.closed) >> message.contacts) != 0) {
    return Refusal::bad_closed;
  }
  if (!is_number(message.sequence) || !is_number(message.records_total) || message.records < 0 ||
      message.records > max_records || message.records > message.records_total) {
    return Refusal::bad_count;
  }
  for (std::int32_t i = 0; i < message.records; ++i) {
    const double last = i > 0 ? message.t[i - 1] : 0.0;
    if (!is_duration(message.t[i]) || message.t[i] < last) return Refusal::bad_time;
    if (message.contact[i] < 1 || message.contact[i] > message.contacts) {
      return Refusal::bad_contact;
    }
    if (message.kind[i] < static_cast<int>(ContactEventKind::closes) ||
        message.kind[i] > static_cast<int>(ContactEventKind::pulse)) {
      return Refusal::bad_kind;
    }
  }
  return Refusal::none;
}

Refusal validate(const input_t& message) {
  if (!std::isfinite(message.t0) || !std::isfinite(message.dt) || !(message.dt > 0.0)) {
    return Refusal::bad_time;
  }
  if (message.channels < 1 || message.channels > max_input_channels ||
      !is_number(message.sequence) || !is_number(message.total) || message.n < 1 ||
      message.n > message.total || message.n > max_input_values / message.channels) {
    return Refusal::bad_count;
  }
  const auto used =
      std::span(message.value)
          .first(static_cast<std::size_t>(message.n) * static_cast<std::size_t>(message.channels));
  return std::ranges::all_of(used, [](double x) { return std::isfinite(x); }) ? Refusal::none
                                                                              : Refusal::bad_value;
}

Refusal validate(const state_t& message) { return check_state(message); }

Refusal validate(const estimate_t& message) {
  if (const Refusal refusal = check_state(message); refusal != Refusal::none) return refusal;
  if (message.settled_tick < -1) return Refusal::bad_time;
  if ((message.deviations != 0 && message.deviations != message.f) || message.gaps > max_contacts) {
    return Refusal::bad_count;
  }
  const bool possible =
      message.estimators >= 0 && message.estimators <= 3 &&
      (message.from_filter == 0 || message.from_filter == 1) && message.bound >= 0.0 &&
      none_negative(message.sigma_q) && none_negative(message.sigma_u) &&
      none_negative(message.sigma_g) && std::isfinite(message.closing) &&
      message.closing_contact >= 0 && message.closing_contact <= max_contacts &&
      std::isfinite(message.replica_gap) && std::isfinite(message.filter_gap) &&
      !std::isnan(message.sigma_filter_gap) && message.inconsistencies >= 0 &&
      std::isfinite(message.suspect_t) && message.suspect_contact >= 0 &&
      message.suspect_contact <= max_contacts && message.suspicion >= 0 && message.suspicion <= 3;
  return possible ? Refusal::none : Refusal::bad_value;
}

Refusal validate(const outputs_t& message) { return check_named_values(message, message.name); }

Refusal validate(const parameters_t& message) {
  const Refusal refusal = check_named_values(message, message.key);
  if (refusal != Refusal::none) return refusal;
  const bool possible = std::isfinite(message.accepted) && std::isfinite(message.known) &&
                        message.identifications >= 0;
  return possible ? Refusal::none : Refusal::bad_value;
}

Refusal validate(const bounds_t& message) {
  if (!is_duration(message.t) || message.tick < 0) return Refusal::bad_time;
  if (!(message.bound >= 0.0) || message.refutations < 0) return Refusal::bad_value;
  const Refusal refusal = check_names(message.name);
  if (refusal != Refusal::none) return refusal;
  return none_negative(message.half_width) ? Refusal::none : Refusal::bad_value;
}

Refusal validate(const health_t& message) {
  constexpr std::int32_t most_causes = 64;
  constexpr std::size_t longest_cause = 63;
  if (message.tick < -1 || (message.t != -1.0 && !is_duration(message.t))) {
    return Refusal::bad_time;
  }
  for (const double time :
       {message.period, message.latency_p50, message.latency_p99, message.latency_max,
        message.lateness_p50, message.lateness_p99, message.lateness_max}) {
    if (!is_duration(time)) return Refusal::bad_time;
  }
  if (!is_duration(message.real_time_factor) || !(message.speed >= 0.0)) return Refusal::bad_speed;
  if (message.last < 0 || message.last > 1 || message.master < 0 || message.master > 3 ||
      message.estimate < 0 || message.estimate > 3 || message.input < 0 || message.input > 2) {
    return Refusal::bad_value;
  }
  for (const std::int64_t count : {message.latencies,
                                   message.sessions,
                                   message.ticks,
                                   message.deadlines,
                                   message.missed_deadlines,
                                   message.real_time_losses,
                                   message.events,
                                   message.late_events,
                                   message.lost_events,
                                   message.gaps,
                                   message.skipped_events,
                                   message.rollbacks,
                                   message.inconsistencies,
                                   message.messages,
                                   message.lost_messages,
                                   message.doubled_messages,
                                   message.reordered_messages,
                                   message.other_masters,
                                   message.stale,
                                   message.overflowed,
                                   message.unsent}) {
    if (count < 0) return Refusal::bad_count;
  }
  if (message.causes > most_causes) return Refusal::bad_count;
  for (const std::string& cause : message.cause) {
    if (cause.empty() || cause.size() > longest_cause) return Refusal::bad_count;
    const auto printable = [](char c) { return c >= 0x20 && c < 0x7f; };
    if (!std::ranges::all_of(cause, printable)) return Refusal::bad_value;
  }
  const bool countable =
      std::ranges::all_of(message.refused, [](std::int64_t count) { return count >= 0; });
  return countable ? Refusal::none : Refusal::bad_count;
}

template <class Message>
std::span<const std::uint8_t> encode(const Message& message, std::vector<std::uint8_t>& buffer) {
  const int size = message.getEncodedSize();
  buffer.resize(static_cast<std::size_t>(size));
  message.encode(buffer.data(), 0, size);
  return buffer;
}

template <class Message>
Refusal decode(std::span<const std::uint8_t> bytes, Message& message) {
  const std::uint8_t* from = bytes.data();
  if (bytes.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != Message::getHash()) return Refusal::wrong_type;
  Lengths lengths(bytes);
  for (const Block& block : blocks<Message>) {
    if (const Refusal refusal = lengths.pass(block); refusal != Refusal::none) return refusal;
  }
  clear(message);
  const int size = static_cast<int>(bytes.size());
  const int read = message.decode(bytes.data(), 0, size);
  if (read < 0) return Refusal::truncated;
  return read < size ? Refusal::oversized : validate(message);
}

template std::span<const std::uint8_t> encode(const contacts_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const input_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const state_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const estimate_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const outputs_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const parameters_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const bounds_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const health_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const impact_t&, std::vector<std::uint8_t>&);
template std::span<const std::uint8_t> encode(const prediction_t&, std::vector<std::uint8_t>&);
template Refusal decode(std::span<const std::uint8_t>, contacts_t&);
template Refusal decode(std::span<const std::uint8_t>, input_t&);
template Refusal decode(std::span<const std::uint8_t>, state_t&);
template Refusal decode(std::span<const std::uint8_t>, estimate_t&);
template Refusal decode(std::span<const std::uint8_t>, outputs_t&);
template Refusal decode(std::span<const std::uint8_t>, parameters_t&);
template Refusal decode(std::span<const std::uint8_t>, bounds_t&);
template Refusal decode(std::span<const std::uint8_t>, health_t&);

}  // namespace sprag
