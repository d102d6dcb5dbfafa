#include "lcmtypes/contacts_codec.h"

#include <cmath>
#include <sprag/contacts_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

static_assert(contacts_message_size == 1272);

namespace {

constexpr std::int64_t largest_number = std::int64_t{1} << 53;

bool is_number(std::int64_t n) { return n >= 0 && n <= largest_number; }

bool is_time(double t) { return std::isfinite(t) && t >= 0.0; }

Refusal check_head(const ContactReport& report) {
  if (!(report.speed > 0.0)) return Refusal::bad_speed;
  if (!is_time(report.horizon)) return Refusal::bad_time;
  if (report.contacts < 1 || report.contacts > max_contacts) return Refusal::bad_count;
  if ((report.closed >> report.contacts) != 0) return Refusal::bad_closed;
  if (!is_number(report.sequence) || !is_number(report.records_total)) return Refusal::bad_count;
  if (report.records < 0 || report.records > max_records || report.records > report.records_total)
    return Refusal::bad_count;
  return Refusal::none;
}

}  // namespace

void encode(const ContactReport& report, ContactsMessage& message) noexcept {
  const auto used = std::span(report.record).first(static_cast<std::size_t>(report.records));
  const std::size_t unused = max_records - used.size();
  std::uint8_t* to = message.data();
  put(to, contacts_t::getHash());
  put(to, report.session);
  put(to, report.sequence);
  put(to, report.utime);
  put(to, report.speed);
  put(to, report.horizon);
  put(to, report.closed);
  put(to, std::int32_t{report.contacts});
  put(to, report.records_total);
  for (const ContactEvent& event : used) put(to, event.t);
  for (std::size_t i = 0; i < unused; ++i) put(to, 0.0);
  for (const ContactEvent& event : used) put(to, static_cast<std::int8_t>(event.contact + 1));
  for (std::size_t i = 0; i < unused; ++i) put(to, std::int8_t{0});
  for (const ContactEvent& event : used) put(to, static_cast<std::int8_t>(event.kind));
  for (std::size_t i = 0; i < unused; ++i) put(to, std::int8_t{0});
  put(to, std::int32_t{report.records});
}

Refusal decode(std::span<const std::uint8_t> message, ContactReport& report) noexcept {
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != contacts_t::getHash()) return Refusal::wrong_type;
  if (message.size() < contacts_message_size) return Refusal::truncated;
  if (message.size() > contacts_message_size) return Refusal::oversized;
  report.session = take<std::int64_t>(from);
  report.sequence = take<std::int64_t>(from);
  report.utime = take<std::int64_t>(from);
  report.speed = take<double>(from);
  report.horizon = take<double>(from);
  report.closed = take<ContactSet>(from);
  report.contacts = take<std::int32_t>(from);
  report.records_total = take<std::int64_t>(from);
  const std::uint8_t* times = from;
  const std::uint8_t* contacts = times + sizeof(double) * max_records;
  const std::uint8_t* kinds = contacts + max_records;
  from = kinds + max_records;
  report.records = take<std::int32_t>(from);
  if (const Refusal refusal = check_head(report); refusal != Refusal::none) return refusal;

  double last = 0.0;
  for (ContactEvent& event :
       std::span(report.record).first(static_cast<std::size_t>(report.records))) {
    event.t = take<double>(times);
    const auto contact = take<std::int8_t>(contacts);
    const auto kind = take<std::int8_t>(kinds);
    if (!is_time(event.t) || event.t < last) return Refusal::bad_time;
    if (contact < 1 || contact > report.contacts) return Refusal::bad_contact;
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
