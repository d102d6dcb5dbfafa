#include "lcmtypes/contacts_codec.h"

#include <cmath>
#include <sprag/contacts_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

static_assert(contacts_message_size == 1272);

namespace {

bool is_number(std::int64_t n) { return n >= 0 && n <= largest_number; }

bool is_time(double t) { return std::isfinite(t) && t >= 0.0; }

Refusal check_head(const ContactMessage& message) {
  if (!(message.speed > 0.0)) return Refusal::bad_speed;
  if (!is_time(message.horizon)) return Refusal::bad_time;
  if (message.contacts < 1 || message.contacts > max_contacts) return Refusal::bad_count;
  if ((message.closed >> message.contacts) != 0) return Refusal::bad_closed;
  if (!is_number(message.sequence) || !is_number(message.records_total)) return Refusal::bad_count;
  if (message.records < 0 || message.records > max_records ||
      message.records > message.records_total)
    return Refusal::bad_count;
  return Refusal::none;
}

}  // namespace

void encode(const ContactMessage& message, EncodedContacts& bytes) noexcept {
  const auto used = std::span(message.record).first(static_cast<std::size_t>(message.records));
  const std::size_t unused = max_records - used.size();
  std::uint8_t* to = bytes.data();
  put(to, contacts_t::getHash());
  put(to, message.session);
  put(to, message.sequence);
  put(to, message.utime);
  put(to, message.speed);
  put(to, message.horizon);
  put(to, message.closed);
  put(to, std::int32_t{message.contacts});
  put(to, message.records_total);
  for (const ContactEvent& event : used) put(to, event.t);
  for (std::size_t i = 0; i < unused; ++i) put(to, 0.0);
  for (const ContactEvent& event : used) put(to, static_cast<std::int8_t>(event.contact + 1));
  for (std::size_t i = 0; i < unused; ++i) put(to, std::int8_t{0});
  for (const ContactEvent& event : used) put(to, static_cast<std::int8_t>(event.kind));
  for (std::size_t i = 0; i < unused; ++i) put(to, std::int8_t{0});
  put(to, std::int32_t{message.records});
}

Refusal decode(std::span<const std::uint8_t> bytes, ContactMessage& message) noexcept {
  const std::uint8_t* from = bytes.data();
  if (bytes.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != contacts_t::getHash()) return Refusal::wrong_type;
  if (bytes.size() < contacts_message_size) return Refusal::truncated;
  if (bytes.size() > contacts_message_size) return Refusal::oversized;
  message.session = take<std::int64_t>(from);
  message.sequence = take<std::int64_t>(from);
  message.utime = take<std::int64_t>(from);
  message.speed = take<double>(from);
  message.horizon = take<double>(from);
  message.closed = take<ContactSet>(from);
  message.contacts = take<std::int32_t>(from);
  message.records_total = take<std::int64_t>(from);
  const std::uint8_t* times = from;
  const std::uint8_t* contacts = times + sizeof(double) * max_records;
  const std::uint8_t* kinds = contacts + max_records;
  from = kinds + max_records;
  message.records = take<std::int32_t>(from);
  if (const Refusal refusal = check_head(message); refusal != Refusal::none) return refusal;

  double last = 0.0;
  for (ContactEvent& event :
       std::span(message.record).first(static_cast<std::size_t>(message.records))) {
    event.t = take<double>(times);
    const auto contact = take<std::int8_t>(contacts);
    const auto kind = take<std::int8_t>(kinds);
    if (!is_time(event.t) || event.t < last) return Refusal::bad_time;
    if (contact < 1 || contact > message.contacts) return Refusal::bad_contact;
    if (kind < static_cast<int>(ContactEventKind::closes) ||
        kind > static_cast<int>(ContactEventKind::pulse))
      return Refusal::bad_kind;
    event.contact = contact - 1;
    event.kind = static_cast<ContactEventKind>(kind);
    last = event.t;
  }
  return Refusal::none;
}

}  // namespace sprag
