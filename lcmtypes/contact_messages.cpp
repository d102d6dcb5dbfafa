#include "lcmtypes/contact_messages.h"

#include <algorithm>
#include <iterator>

#include "lcmtypes/messages.h"

namespace sprag {

std::span<const std::uint8_t> encode(const ContactMessage& content,
                                     std::vector<std::uint8_t>& buffer) {
  contacts_t message{};
  static_assert(std::size(decltype(message.t){}) == max_records);
  message.session = content.session;
  message.sequence = content.sequence;
  message.utime = content.utime;
  message.speed = content.speed;
  message.horizon = content.horizon;
  message.closed = static_cast<std::int64_t>(content.closed);
  message.contacts = content.contacts;
  message.records_total = content.records_total;
  message.records = content.records;
  for (int i = 0; i < content.records; ++i) {
    const ContactEvent& event = content.record[static_cast<std::size_t>(i)];
    message.t[i] = event.t;
    message.contact[i] = static_cast<std::int8_t>(event.contact + 1);
    message.kind[i] = static_cast<std::int8_t>(event.kind);
  }
  return encode(message, buffer);
}

Refusal decode(std::span<const std::uint8_t> bytes, ContactMessage& content) {
  contacts_t message{};
  if (const Refusal refusal = decode(bytes, message); refusal != Refusal::none) return refusal;
  content.session = message.session;
  content.sequence = message.sequence;
  content.utime = message.utime;
  content.speed = message.speed;
  content.horizon = message.horizon;
  content.closed = static_cast<ContactSet>(message.closed);
  content.contacts = message.contacts;
  content.records_total = message.records_total;
  content.records = message.records;
  for (int i = 0; i < message.records; ++i) {
    content.record[static_cast<std::size_t>(i)] = {message.t[i], message.contact[i] - 1,
                                                   static_cast<ContactEventKind>(message.kind[i])};
  }
  return Refusal::none;
}

Refusal decode(std::span<const std::uint8_t> bytes, InputMessage& content) {
  input_t message{};
  static_assert(std::size(decltype(message.value){}) == max_input_values);
  if (const Refusal refusal = decode(bytes, message); refusal != Refusal::none) return refusal;
  content.session = message.session;
  content.sequence = message.sequence;
  content.utime = message.utime;
  content.t0 = message.t0;
  content.dt = message.dt;
  content.total = message.total;
  content.channels = message.channels;
  content.n = message.n;
  std::ranges::copy(message.value, content.value.begin());
  return Refusal::none;
}

}  // namespace sprag
