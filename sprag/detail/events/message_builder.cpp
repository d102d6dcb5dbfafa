#include "sprag/detail/events/message_builder.h"

#include <algorithm>
#include <cmath>

namespace sprag {

MessageBuilder::MessageBuilder(std::int64_t session, double speed, int contacts) {
  message_.session = session;
  message_.speed = speed;
  message_.contacts = contacts;
}

void MessageBuilder::add(std::span<const ContactEvent> events) {
  records_.insert(records_.end(), events.begin(), events.end());
}

const ContactMessage& MessageBuilder::next(double horizon, std::int64_t utime) {
  // Splits a long list between two instants, never within an instant.
  constexpr std::size_t room = max_records;
  std::size_t end = std::min(records_.size(), sent_ + room);
  if (end < records_.size()) {
    std::size_t cut = end;
    while (cut > sent_ && records_[cut - 1].t == records_[cut].t) --cut;
    if (cut > sent_) end = cut;
    horizon = std::nextafter(records_[end].t, 0.0);
  }
  for (std::size_t i = sent_; i < end; ++i) {
    message_.closed = after(message_.closed, records_[i]);
  }
  message_.records_total += static_cast<std::int64_t>(end - sent_);
  sent_ = end;
  while (sent_ > room) {
    records_.pop_front();
    --sent_;
  }
  message_.records = static_cast<int>(sent_);
  std::copy_n(records_.begin(), sent_, message_.record.begin());
  message_.horizon = horizon;
  message_.utime = utime;
  ++message_.sequence;
  return message_;
}

}  // namespace sprag
