#include "observer/event_history.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

constexpr std::size_t max_degraded = 4096;

// chi before the first record a report carries: its `closed`, the records undone.
ContactSet closed_before_records(const ContactReport& report) {
  ContactSet closed = report.closed;
  for (int i = report.records; i-- > 0;) {
    const ContactEvent& event = report.record[static_cast<std::size_t>(i)];
    if (event.contact < 0 || event.contact >= report.contacts) continue;
    if (event.kind == ContactEventKind::opens) {
      closed |= bit(event.contact);
    } else {
      closed &= ~bit(event.contact);
    }
  }
  return closed;
}

}  // namespace

EventHistory::EventHistory(int contacts, std::size_t capacity) : contacts_(contacts) {
  events_.reserve(capacity);
  degraded_.reserve(max_degraded);
}

void EventHistory::restart(std::int64_t next_record, ContactSet chi, double horizon) {
  events_.clear();
  next_record_ = next_record;
  chi_ = chi;
  last_t_ = std::max(horizon, 0.0);
  horizon_ = horizon;
}

bool EventHistory::add(const ContactEvent& event) {
  if (event.contact < 0 || event.contact >= contacts_) {
    ++counts_.unknown_contact;
    return false;
  }
  if (!(event.t >= last_t_) || event.t <= horizon_) {
    ++counts_.backwards;
    return false;
  }
  const bool closed = contains(chi_, event.contact);
  if (closed != (event.kind == ContactEventKind::opens)) {
    ++counts_.contradicting;
    return false;
  }
  chi_ = after(chi_, event);
  last_t_ = event.t;
  events_.push_back(event);
  ++counts_.events;
  return true;
}

std::size_t EventHistory::add(const ContactReport& report) {
  const std::size_t before = events_.size();
  const std::int64_t first = report.records_total - report.records;
  const bool gap = first > next_record_;
  if (gap) {
    counts_.lost_records += first - next_record_;
    const double to = report.records > 0 ? report.record[0].t : report.horizon;
    if (degraded_.size() < max_degraded) degraded_.push_back({std::max(last_t_, horizon_), to});
    next_record_ = first;
    make_up(closed_before_records(report), to);
  }
  for (std::int64_t number = next_record_; number < report.records_total; ++number) {
    const ContactEvent& event = report.record[static_cast<std::size_t>(number - first)];
    if (event.t > report.horizon) {
      ++counts_.beyond_horizon;
    } else {
      (void)add(event);
    }
  }
  next_record_ = std::max(next_record_, report.records_total);
  if (gap) make_up(report.closed, report.horizon);
  set_horizon(report.horizon);
  return events_.size() - before;
}

// Switches the contacts that lost records have left otherwise than `closed`, at t or as soon after
// as nothing settled changes.
void EventHistory::make_up(ContactSet closed, double t) {
  const double after_horizon =
      horizon_ < 0.0 ? 0.0 : std::nextafter(horizon_, std::numeric_limits<double>::infinity());
  for (int i = 0; i < contacts_; ++i) {
    if (contains(closed, i) == contains(chi_, i)) continue;
    const ContactEvent event{
        std::max({t, last_t_, after_horizon}), i,
        contains(closed, i) ? ContactEventKind::closes : ContactEventKind::opens};
    chi_ = after(chi_, event);
    last_t_ = event.t;
    events_.push_back(event);
    ++counts_.events;
    ++counts_.made_up;
  }
}

void EventHistory::set_horizon(double t) { horizon_ = std::max(horizon_, t); }

void EventHistory::drop(std::size_t n) {
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(n));
}

}  // namespace sprag
