#include "sprag/estimation/report_builder.h"

#include <algorithm>
#include <cmath>

namespace sprag {

ReportBuilder::ReportBuilder(std::int64_t session, double speed, int contacts) {
  report_.session = session;
  report_.speed = speed;
  report_.contacts = contacts;
}

void ReportBuilder::add(std::span<const ContactEvent> events) {
  records_.insert(records_.end(), events.begin(), events.end());
}

const ContactReport& ReportBuilder::next(double horizon, std::int64_t utime) {
  // A burst is cut between two instants, never within one.
  constexpr std::size_t room = max_records;
  std::size_t end = std::min(records_.size(), sent_ + room);
  if (end < records_.size()) {
    std::size_t cut = end;
    while (cut > sent_ && records_[cut - 1].t == records_[cut].t) --cut;
    if (cut > sent_) end = cut;
    horizon = std::nextafter(records_[end].t, 0.0);
  }
  for (std::size_t i = sent_; i < end; ++i) {
    report_.closed = after(report_.closed, records_[i]);
  }
  report_.records_total += static_cast<std::int64_t>(end - sent_);
  sent_ = end;
  while (sent_ > room) {
    records_.pop_front();
    --sent_;
  }
  report_.records = static_cast<int>(sent_);
  std::copy_n(records_.begin(), sent_, report_.record.begin());
  report_.horizon = horizon;
  report_.utime = utime;
  ++report_.sequence;
  return report_;
}

}  // namespace sprag
