#include "lcmtypes/input_codec.h"

#include <cmath>
#include <sprag/input_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

static_assert(input_message_size < 1400);

namespace {

Refusal check_head(const InputMessage& message) {
  const auto is_number = [](std::int64_t n) { return n >= 0 && n <= largest_number; };
  if (!std::isfinite(message.t0) || !std::isfinite(message.dt) || !(message.dt > 0.0)) {
    return Refusal::bad_time;
  }
  if (message.channels < 1 || message.channels > max_input_channels) return Refusal::bad_count;
  if (!is_number(message.sequence) || !is_number(message.total)) return Refusal::bad_count;
  if (message.n < 1 || message.n > message.total ||
      message.n > max_input_values / message.channels) {
    return Refusal::bad_count;
  }
  return Refusal::none;
}

}  // namespace

void encode(const InputMessage& message, EncodedInput& bytes) noexcept {
  std::uint8_t* to = bytes.data();
  put(to, input_t::getHash());
  put(to, message.session);
  put(to, message.sequence);
  put(to, message.utime);
  put(to, message.t0);
  put(to, message.dt);
  put(to, message.total);
  put(to, std::int32_t{message.channels});
  put(to, std::int32_t{message.n});
  const auto used =
      static_cast<std::size_t>(message.n) * static_cast<std::size_t>(message.channels);
  for (std::size_t i = 0; i < message.value.size(); ++i) put(to, i < used ? message.value[i] : 0.0);
}

Refusal decode(std::span<const std::uint8_t> bytes, InputMessage& message) noexcept {
  const std::uint8_t* from = bytes.data();
  if (bytes.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != input_t::getHash()) return Refusal::wrong_type;
  if (bytes.size() < input_message_size) return Refusal::truncated;
  if (bytes.size() > input_message_size) return Refusal::oversized;
  message.session = take<std::int64_t>(from);
  message.sequence = take<std::int64_t>(from);
  message.utime = take<std::int64_t>(from);
  message.t0 = take<double>(from);
  message.dt = take<double>(from);
  message.total = take<std::int64_t>(from);
  message.channels = take<std::int32_t>(from);
  message.n = take<std::int32_t>(from);
  if (const Refusal refusal = check_head(message); refusal != Refusal::none) return refusal;
  const auto used =
      static_cast<std::size_t>(message.n) * static_cast<std::size_t>(message.channels);
  for (std::size_t i = 0; i < used; ++i) {
    message.value[i] = take<double>(from);
    if (!std::isfinite(message.value[i])) return Refusal::bad_value;
  }
  return Refusal::none;
}

}  // namespace sprag
