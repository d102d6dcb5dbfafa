#include "sprag/detail/events/event_history.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

constexpr std::size_t max_degraded = 4096;

// chi before the first record of a message: its `closed`, with the records undone.
ContactSet closed_before_records(const ContactMessage& message) {
  ContactSet closed = message.closed;
  for (int i = message.records; i-- > 0;) {
    const ContactEvent& event = message.record[static_cast<std::size_t>(i)];
    if (event.contact < 0 || event.contact >= message.contacts) continue;
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
  dropped_ = 0;
  next_record_ = next_record;
  chi_ = chi;
  last_t_ = std::max(horizon, 0.0);
  last_of_.fill(last_t_);
  horizon_ = horizon;
  ++start_;
}

bool EventHistory::add(const ContactEvent& event) {
  if (event.contact < 0 || event.contact >= contacts_) {
    return skip(Skip::unknown_contact, event, event.t);
  }
  if (!(event.t >= last_t_) || event.t <= horizon_) return skip(Skip::backwards, event, event.t);
  const bool closed = contains(chi_, event.contact);
  if (closed != (event.kind == ContactEventKind::opens)) {
    // The missing event is later than the contact's last event.
    return skip(Skip::contradicting, event, last_of_[static_cast<std::size_t>(event.contact)]);
  }
  append(event);
  return true;
}

void EventHistory::append(const ContactEvent& event) {
  chi_ = after(chi_, event);
  last_t_ = last_of_[static_cast<std::size_t>(event.contact)] = event.t;
  events_.push_back(event);
  ++counts_.events;
}

// The bound of a settled tick must not depend on whether the tick is returned before or after a
// later message arrives. An interval therefore never begins before the horizon.
void EventHistory::degrade(double from, double to) {
  from = std::isnan(from) ? horizon_ : from;
  from = std::max({from, horizon_, 0.0});
  to = to > from ? to : from;
  const bool full = degraded_.size() == max_degraded;
  if (!degraded_.empty() && degraded_.back().start == start_ &&
      (full || from <= degraded_.back().to)) {
    degraded_.back().from = std::min(degraded_.back().from, from);
    degraded_.back().to = std::max(degraded_.back().to, to);
  } else if (!full) {
    degraded_.push_back({from, to, start_});
  }
}

bool EventHistory::lost_before(double t, std::size_t events) const {
  const auto earlier = [](double time, const ContactEvent& event) { return time < event.t; };
  for (auto interval = degraded_.rbegin(); interval != degraded_.rend(); ++interval) {
    if (interval->start != start_) return false;
    if (interval->from > t) continue;
    const auto first = std::upper_bound(events_.begin(), events_.end(), interval->to, earlier);
    const auto last = std::upper_bound(first, events_.end(), t, earlier);
    return static_cast<std::size_t>(last - first) <= events;
  }
  return false;
}

void EventHistory::lose(const ContactMessage& message) {
  counts_.lost_records += std::max<std::int64_t>(message.records_total - next_record_, 0);
  if (message.horizon > horizon_) degrade(last_t_, message.horizon);
}

bool EventHistory::skip(Skip cause, const ContactEvent& event, double missing_from) {
  const auto index = static_cast<std::size_t>(cause);
  ++counts_.skipped[index];
  last_skipped_[index] = event;
  degrade(missing_from, event.t);
  return false;
}

std::size_t EventHistory::add(const ContactMessage& message) {
  const std::size_t before = events_.size();
  const std::int64_t first = message.records_total - message.records;
  const bool gap = first > next_record_;
  if (gap) {
    counts_.lost_records += first - next_record_;
    const double to = message.records > 0 ? message.record[0].t : message.horizon;
    degrade(last_t_, to);
    next_record_ = first;
    make_up(closed_before_records(message), to);
  }
  for (std::int64_t number = next_record_; number < message.records_total; ++number) {
    const ContactEvent& event = message.record[static_cast<std::size_t>(number - first)];
    if (event.t > message.horizon) {
      (void)skip(Skip::beyond_horizon, event, horizon_);
    } else {
      (void)add(event);
    }
  }
  next_record_ = std::max(next_record_, message.records_total);
  if (gap) make_up(message.closed, message.horizon);
  set_horizon(message.horizon);
  return events_.size() - before;
}

// Inserts events for the contacts whose state differs from `closed` after lost records, at t or at
// the first later time that changes no settled tick.
void EventHistory::make_up(ContactSet closed, double t) {
  const double after_horizon =
      horizon_ < 0.0 ? 0.0 : std::nextafter(horizon_, std::numeric_limits<double>::infinity());
  for (int i = 0; i < contacts_; ++i) {
    if (contains(closed, i) == contains(chi_, i)) continue;
    append({std::max({t, last_t_, after_horizon}), i,
            contains(closed, i) ? ContactEventKind::closes : ContactEventKind::opens});
    ++counts_.made_up;
  }
}

void EventHistory::set_horizon(double t) { horizon_ = std::max(horizon_, t); }

void EventHistory::drop(std::size_t n) {
  dropped_ += static_cast<std::int64_t>(n);
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(n));
}

}  // namespace sprag
