// ContactMessage <-> sprag_contacts_t. Contacts count from 0 in memory and from 1 in messages.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "lcmtypes/refusal.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

/// Bytes of a message: type hash, head, records, number of records. With the channel name and LCM's
/// header it is shorter than 1400, so that it fits into one packet and is never fragmented.
inline constexpr std::size_t contacts_message_size =
    8 + 6 * 8 + 4 + 8 + std::size_t{max_records} * (8 + 1 + 1) + 4;

using EncodedContacts = std::array<std::uint8_t, contacts_message_size>;

/// Unused records are written as zeros. Requires 0 <= message.records <= max_records.
void encode(const ContactMessage& message, EncodedContacts& bytes) noexcept;

/// Reads `message` and returns Refusal::none, or why the bytes are refused; `message` is
/// unspecified then. Accepted: 1 <= contacts <= 60, 0 <= records <= min(120, records_total),
/// sequence and records_total from 0 to 2^53, finite ascending times >= 0, speed > 0 (possibly
/// infinite).
Refusal decode(std::span<const std::uint8_t> bytes, ContactMessage& message) noexcept;

}  // namespace sprag
