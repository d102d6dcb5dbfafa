// Contents of messages in the library's terms <-> contacts_t and input_t. Contacts count from 0 in
// the library and from 1 in messages.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/refusal.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {

/// Encodes contacts_t; unused records are zeros. The result is in `buffer` and valid until the
/// buffer is changed. Requires 0 <= content.records <= max_records.
std::span<const std::uint8_t> encode(const ContactMessage& content,
                                     std::vector<std::uint8_t>& buffer);

/// Decodes contacts_t or input_t. Returns Refusal::none, or why the bytes are refused; `content` is
/// unchanged then. Allocates nothing.
Refusal decode(std::span<const std::uint8_t> bytes, ContactMessage& content);
Refusal decode(std::span<const std::uint8_t> bytes, InputMessage& content);

}  // namespace sprag
