// InputMessage <-> sprag_input_t.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "lcmtypes/refusal.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {

/// Bytes of a message: type hash, head, values. One packet, as a contact message.
inline constexpr std::size_t input_message_size =
    8 + 3 * 8 + 2 * 8 + 8 + 2 * 4 + std::size_t{max_input_values} * 8;

using EncodedInput = std::array<std::uint8_t, input_message_size>;

/// Unused values are written as zeros. Requires n channels <= max_input_values.
void encode(const InputMessage& message, EncodedInput& bytes) noexcept;

/// Reads `message` and returns Refusal::none, or why the bytes are refused; `message` is
/// unspecified then. Accepted: 1 <= channels <= 8, 1 <= n <= total <= 2^53, n channels <= 150,
/// sequence from 0 to 2^53, finite t0 and values, dt > 0.
Refusal decode(std::span<const std::uint8_t> bytes, InputMessage& message) noexcept;

}  // namespace sprag
