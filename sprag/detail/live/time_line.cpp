#include "sprag/detail/live/time_line.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/instant.h"

namespace sprag {

TimeLine::TimeLine(TrackingEstimator& estimator, int contacts, const State& start,
                   std::int64_t history)
    : estimator_(&estimator), start_(start), history_(history), events_(contacts, event_capacity) {
  saved_.resize(static_cast<std::size_t>(history) + 2);
  if (estimator.family() != nullptr) adaptation_.emplace(estimator);
  estimator.start(start, 0, 0, frontier_);
  for (TrackingState& state : saved_) state = frontier_;
}

void TimeLine::restart(std::int64_t k, std::int64_t next_record, ContactSet chi, double horizon) {
  events_.restart(next_record, chi, horizon);
  first_ = now_ = k;
  ++starts_;
  chi_ = chi;
  waits_ = false;
  if (adaptation_) adaptation_->start(tick_instant(k, h()).hi, chi);
  consumed_ = 0;
  handed_out_ = reached_ = k - 1;
  started_ = true;
  frontier_tick_ = no_tick;
  next_t_ = -1.0;
  start_again();
}

void TimeLine::restart(const ContactMessage& message) {
  const bool whole = message.records_total == message.records;
  if (whole && last_tick(message.horizon, h()) <= far) {
    restart(0, 0, 0, no_horizon);
    receive(message);
  } else {
    restart_after(message);
  }
}

void TimeLine::restart_after(const ContactMessage& message) {
  restart(last_tick(message.horizon, h()) + 1, message.records_total, message.closed,
          message.horizon);
}

bool TimeLine::receive(const ContactMessage& message) {
  const bool gap = message.records_total - message.records > events_.next_record();
  if (gap && is_far(message.horizon)) {
    events_.lose(message);
    restart_after(message);
    return true;
  }
  const std::size_t known = events_.events().size();
  if (events_.add(message) > 0) go_back(known);
  return false;
}

bool TimeLine::resume(const ContactMessage& message) {
  if (message.horizon >= events_.horizon() && !is_far(message.horizon) &&
      message.records_total >= events_.next_record()) {
    return receive(message);
  }
  events_.lose(message);
  restart_after(message);
  return true;
}

void TimeLine::receive(const ContactEvent& event) {
  const std::size_t known = events_.events().size();
  if (events_.add(event)) go_back(known);
}

void TimeLine::receive_input(double from, double t) {
  input_horizon_ = t;
  if (!started_) return;
  const std::int64_t last = from > 0.0 ? first_tick_after(from, h()) - 1 : -1;
  if (last < first_) {
    start_again();
  } else if (std::max(last, handed_out_) < now_) {
    redo_after(std::max(last, handed_out_));
  }
}

void TimeLine::set_lag(double lag, std::int64_t last) {
  lag_ = lag;
  last_asked_ = last;
}

void TimeLine::finish(const AdaptationResult& result) {
  waits_ = false;
  go_back_to(handed_out_);
  adaptation_->finish(result, saved(handed_out_));
}

bool TimeLine::identify() {
  if (!waits_) return false;
  finish(sprag::run(task(), *estimator_->family()));
  return true;
}

void TimeLine::go_back_to(std::int64_t k) {
  k = std::max({k, handed_out_, first_});
  if (k < oldest_ && frontier_tick_ != handed_out_) k = oldest_;
  if (started_ && k < now_) redo_after(k);
}

void TimeLine::start_again() {
  now_ = oldest_ = first_;
  TrackingState& state = saved(first_);
  estimator_->start(start_, first_, chi_, state);
  consumed_ = 0;
  for_each_instant(events_of(first_),
                   [&](std::span<const ContactEvent> of_one) { estimator_->apply(of_one, state); });
}

std::span<const ContactEvent> TimeLine::events_at(std::int64_t k) const {
  const auto& all = events_.events();
  const auto first = std::partition_point(
      all.begin(), all.end(), [&](const ContactEvent& event) { return tick_of(event) < k; });
  const auto end =
      std::find_if(first, all.end(), [&](const ContactEvent& event) { return tick_of(event) > k; });
  return {first, end};
}

void TimeLine::step() {
  if (now_ + 1 - oldest_ == static_cast<std::int64_t>(saved_.size())) {
    if (oldest_ == handed_out_) {
      frontier_ = saved(oldest_);
      frontier_tick_ = handed_out_;
    }
    oldest_slot_ = slot(oldest_ + 1);
    ++oldest_;
  }
  const TrackingState& from = saved(now_);
  TrackingState& to = saved(now_ + 1);
  to = from;
  ++now_;
  estimator_->tick(events_of(now_), to);
}

void TimeLine::go_back(std::size_t first_new) {
  const std::int64_t tick = tick_of(events_.events()[first_new]);
  if (tick > now_) return;
  ++rollbacks_.rollbacks;
  rollbacks_.depth.add(now_ - tick + 1);
  const std::int64_t present = now_;
  if (tick == first_) {
    if (oldest_ > first_) ++rollbacks_.beyond_history;
    start_again();
  } else {
    if (oldest_ > tick - 1) ++rollbacks_.beyond_history;
    redo_after(tick - 1);
  }
  rollbacks_.ticks_redone += present - now_;
}

void TimeLine::redo_after(std::int64_t k) {
  if (k >= oldest_) {
    now_ = k;
  } else if (handed_out_ < first_) {
    start_again();
    return;
  } else {
    now_ = oldest_ = handed_out_;
    saved(now_) = frontier_;
  }
  const auto& all = events_.events();
  while (consumed_ > 0 && tick_of(all[consumed_ - 1]) > now_) --consumed_;
}

void TimeLine::forget() {
  if (consumed_ < event_capacity / 2 || handed_out_ <= first_) return;
  const auto& all = events_.events();
  std::size_t n = 0;
  while (n < consumed_ && tick_of(all[n]) <= handed_out_) ++n;
  events_.drop(n);
  consumed_ -= n;
}

}  // namespace sprag
