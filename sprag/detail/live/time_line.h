// The observer's time line. Ticks are at t_k = k h of simulated time. The estimator runs ahead to
// "now"; when an event turns up that is older than now, the time line goes back to the last tick
// before it and runs forward again, so that every tick is what it would have been without delay.
// Ticks up to the horizon (all events known) are settled: they are handed out once, in order, and
// depend on the events alone. The last ticks are kept to go back to, and always the last settled
// one: an event that is older than what is kept costs more, never accuracy. A pure core: it knows
// neither clock nor transport, and does not allocate once it is made.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/live/histogram.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/model.h"

namespace sprag {

struct RollbackCounts {
  std::int64_t rollbacks = 0;
  std::int64_t ticks_redone = 0;
  std::int64_t beyond_history = 0;  ///< went back further than the history, to the settled tick
  Histogram depth;                  ///< ticks redone by each
};

template <Estimator E>
class TimeLine {
 public:
  using EstimatorState = typename E::State;

  /// Keeps at least `history` ticks (>= 1) to go back to.
  TimeLine(E& estimator, int contacts, const State& start, std::int64_t history)
      : estimator_(&estimator),
        start_(start),
        history_(history),
        events_(contacts, event_capacity) {
    saved_.resize(static_cast<std::size_t>(history) + 2);
    estimator.start(start, 0, 0, frontier_);
    for (EstimatorState& state : saved_) state = frontier_;
  }

  /// Puts the start at tick k; every event before has been dealt with.
  void restart(std::int64_t k, std::int64_t next_record, ContactSet chi, double horizon) {
    events_.restart(next_record, chi, horizon);
    first_ = now_ = k;
    ++starts_;
    chi_ = chi;
    hold_ = no_hold;
    consumed_ = 0;
    handed_out_ = reached_ = k - 1;
    started_ = true;
    frontier_tick_ = no_tick;
    next_t_ = -1.0;
    start_again();
  }

  /// Starts from the first message of a session: at t = 0 if it still carries every event since
  /// then and its horizon is not far, else at the first tick after its horizon. A machine's clock
  /// may start anywhere.
  void restart(const ContactMessage& message) {
    const bool whole = message.records_total == message.records;
    if (whole && last_tick(message.horizon, h()) <= far) {
      restart(0, 0, 0, no_horizon);
      receive(message);
    } else {
      restart_after(message);
    }
  }

  /// Takes what is new in a message, and goes back if it is older than now. run() goes forward.
  /// Behind a long gap of which nothing is known it starts again, at the first tick after the
  /// message's horizon: then true.
  bool receive(const ContactMessage& message) {
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

  /// The same when the machine's clock or its counts have jumped: starts again too where the
  /// message does not go on from those before, or is far ahead of them.
  bool resume(const ContactMessage& message) {
    if (message.horizon >= events_.horizon() && !is_far(message.horizon) &&
        message.records_total >= events_.next_record()) {
      return receive(message);
    }
    events_.lose(message);
    restart_after(message);
    return true;
  }

  /// Takes one event from a file.
  void receive(const ContactEvent& event) {
    const std::size_t known = events_.events().size();
    if (events_.add(event)) go_back(known);
  }

  /// Every event up to t is known.
  void set_horizon(double t) { events_.set_horizon(t); }

  /// Ticks settle when every event up to `lag` [s] after them is known, but for those from tick
  /// `last` on: nothing later is asked for.
  void set_lag(double lag, std::int64_t last = max_tick) {
    lag_ = lag;
    last_asked_ = last;
  }

  /// Events may be missing between these times.
  void degrade(double from, double to) { events_.degrade(from, to); }

  /// Hands out nothing behind tick k, the last one handed out or about to be, until release() or a
  /// restart: what follows it depends on more than events. Ticks are run through all the same.
  void hold(std::int64_t k) { hold_ = k; }
  bool held() const { return hold_ != no_hold; }
  /// The ticks behind that one are run through anew.
  void release() {
    hold_ = no_hold;
    go_back_to(handed_out_);
  }

  /// Goes back to a tick, or to the last one handed out if that is later. Changes no tick.
  void go_back_to(std::int64_t k) {
    k = std::max({k, handed_out_, first_});
    if (k < oldest_ && frontier_tick_ != handed_out_) k = oldest_;
    if (started_ && k < now_) redo_after(k);
  }

  /// Runs to tick `target`, or as far as the horizon when that is later, by at most `budget` ticks;
  /// returns whether it got there. `on_tick(state)` sees every tick reached for the first time,
  /// `on_settled(state)` every settled one, once and in order; it may return false to be asked
  /// again at the next call, and while it does so the time line waits for it.
  template <typename OnTick, typename OnSettled>
  bool run(std::int64_t target, OnTick&& on_tick, OnSettled&& on_settled,
           std::int64_t budget = std::numeric_limits<std::int64_t>::max()) {
    if (!started_) return true;
    // Nothing is received meanwhile, but ticks may be held.
    const std::int64_t known = known_tick();
    const auto settled = [&] { return std::min(known, hold_); };
    target = std::max(target, settled());
    if (handed_out_ < settled() && handed_out_ + 1 < oldest_) redo_after(handed_out_);
    bool arrived = false;
    while (true) {
      if (now_ > reached_) {
        reached_ = now_;
        on_tick(saved(now_));
      }
      while (handed_out_ < std::min(settled(), now_)) {
        if (!on_settled(saved(handed_out_ + 1))) break;
        ++handed_out_;
      }
      arrived = now_ >= target;
      const bool waits = handed_out_ < settled() && now_ >= handed_out_ + history_;
      if (arrived || waits || budget-- <= 0) break;
      if (handed_out_ == now_ && now_ < settled()) {
        step_in_place();
      } else {
        step();
      }
    }
    forget();
    return arrived;
  }

  /// For who asks each settled tick for note() alone: where all ticks up to now are handed out,
  /// those of free flight in front of the next event, up to tick `last`, are taken as handed out
  /// without being shown. Returns how many, some 10 000 at most.
  std::int64_t coast(std::int64_t last) requires requires(E e, EstimatorState& state) {
    e.coast(std::int64_t{}, state);
  }
  {
    if (!started_ || handed_out_ != now_) return 0;
    last = std::min({last, settled_tick(), next_event_tick() - 1});
    if (last <= now_) return 0;
    oldest_slot_ = slot(now_);
    const std::int64_t taken = estimator_->coast(std::min(last - now_, most_coasted), saved(now_));
    reached_ = handed_out_ = oldest_ = now_ += taken;
    return taken;
  }

  bool started() const { return started_; }
  double h() const { return estimator_->h(); }
  /// Whether the estimate has heard of every event from t = 0 on up to t, which then is not behind
  /// the horizon, as far as is known.
  bool complete_to(double t) const {
    return first_ == 0 && t <= std::min(events_.complete_to(), events_.horizon());
  }
  std::int64_t now() const { return now_; }
  /// How often it has been started, and the tick and chi of the last start.
  std::int64_t starts() const { return starts_; }
  std::int64_t first_tick() const { return first_; }
  ContactSet first_closed() const { return chi_; }
  /// The state at tick now().
  const EstimatorState& present() const { return saved(now_); }
  /// The first tick that contains all events that are known.
  std::int64_t tick_of_last_event() const {
    return events_.events().empty() ? first_ : tick_of(events_.events().back());
  }
  /// Last tick at or before the horizon, and not behind one that is held; before the first tick
  /// where there is none.
  std::int64_t settled_tick() const { return std::min(known_tick(), hold_); }
  /// Last tick handed out as settled.
  std::int64_t handed_out() const { return handed_out_; }
  const EventHistory& events() const { return events_; }
  const RollbackCounts& rollbacks() const { return rollbacks_; }

 private:
  static constexpr std::int64_t no_tick = -2;
  static constexpr std::int64_t no_hold = std::numeric_limits<std::int64_t>::max();
  static constexpr std::size_t event_capacity = 1U << 16U;
  // Ticks that are run through at a start or behind a gap: some tenths of a second.
  static constexpr std::int64_t far = 100'000;
  // Milliseconds with a large machine: callers have more to do than that.
  static constexpr std::int64_t most_coasted = 16'384;

  // The last tick up to which every event is known.
  std::int64_t received_tick() const {
    if (events_.horizon() < 0.0) return first_ - 1;
    return std::max(last_tick(events_.horizon(), h()), first_ - 1);
  }
  // And up to `lag_` after it.
  std::int64_t known_tick() const {
    const std::int64_t heard = received_tick();
    if (lag_ == 0.0 || heard >= last_asked_ || heard < first_) return heard;
    const double waited = events_.horizon() - lag_;
    return waited < 0.0 ? first_ - 1 : std::max(last_tick(waited, h()), first_ - 1);
  }
  bool is_far(double horizon) const { return last_tick(horizon, h()) - received_tick() > far; }

  void restart_after(const ContactMessage& message) {
    restart(last_tick(message.horizon, h()) + 1, message.records_total, message.closed,
            message.horizon);
  }

  EstimatorState& saved(std::int64_t k) { return saved_[slot(k)]; }
  const EstimatorState& saved(std::int64_t k) const { return saved_[slot(k)]; }
  std::size_t slot(std::int64_t k) const {
    const std::size_t slot = oldest_slot_ + static_cast<std::size_t>(k - oldest_);
    return slot < saved_.size() ? slot : slot - saved_.size();
  }

  // First tick at or after the event.
  std::int64_t tick_of(const ContactEvent& event) const {
    return std::max(first_tick_after(event.t, h()), first_);
  }

  // Of the event at `consumed_`.
  std::int64_t next_event_tick() {
    const auto& all = events_.events();
    if (consumed_ == all.size()) return std::numeric_limits<std::int64_t>::max();
    if (all[consumed_].t != next_t_) {
      next_t_ = all[consumed_].t;
      next_tick_ = tick_of(all[consumed_]);
    }
    return next_tick_;
  }

  // The events of one tick, from `consumed_` on.
  std::span<const ContactEvent> events_of(std::int64_t k) {
    if (next_event_tick() != k) return {};
    const auto& all = events_.events();
    std::size_t end = consumed_ + 1;
    while (end < all.size() && tick_of(all[end]) == k) ++end;
    const std::span<const ContactEvent> events(all.data() + consumed_, end - consumed_);
    consumed_ = end;
    return events;
  }

  void start_again() {
    now_ = oldest_ = first_;
    EstimatorState& state = saved(first_);
    estimator_->start(start_, first_, chi_, state);
    consumed_ = 0;
    for_each_instant(events_of(first_), [&](std::span<const ContactEvent> of_one) {
      estimator_->apply(of_one, state);
    });
  }

  void step() {
    if (now_ + 1 - oldest_ == static_cast<std::int64_t>(saved_.size())) {
      if (oldest_ == handed_out_) {
        frontier_ = saved(oldest_);
        frontier_tick_ = handed_out_;
      }
      oldest_slot_ = slot(oldest_ + 1);
      ++oldest_;
    }
    const EstimatorState& from = saved(now_);
    EstimatorState& to = saved(now_ + 1);
    to = from;
    ++now_;
    estimator_->tick(events_of(now_), to);
  }

  // Where nothing goes back behind the next tick any more: it takes the place of this one.
  void step_in_place() {
    oldest_slot_ = slot(now_);
    oldest_ = ++now_;
    estimator_->tick(events_of(now_), saved(now_));
  }

  // Back to the last tick before the event number `first_new`.
  void go_back(std::size_t first_new) {
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

  // The state at tick k >= handed_out_ becomes the present one, or an earlier one if it is not
  // kept.
  void redo_after(std::int64_t k) {
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

  // Events of ticks that are handed out are not needed again, except those of the first tick.
  void forget() {
    if (consumed_ < event_capacity / 2 || handed_out_ <= first_) return;
    const auto& all = events_.events();
    std::size_t n = 0;
    while (n < consumed_ && tick_of(all[n]) <= handed_out_) ++n;
    events_.drop(n);
    consumed_ -= n;
  }

  E* estimator_;
  State start_;
  std::int64_t history_;
  EventHistory events_;
  std::vector<EstimatorState> saved_;  // ring, of the ticks from oldest_ to now_
  std::size_t oldest_slot_ = 0;
  // At handed_out_, where that is older than oldest_ and may be gone back to.
  EstimatorState frontier_;
  std::int64_t frontier_tick_ = no_tick;
  bool started_ = false;
  std::int64_t starts_ = 0;
  ContactSet chi_ = 0;  // at the first tick
  std::int64_t first_ = 0;
  std::int64_t oldest_ = 0;
  std::int64_t now_ = 0;
  std::int64_t reached_ = -1;
  std::int64_t handed_out_ = -1;
  std::int64_t hold_ = no_hold;
  double lag_ = 0.0;  // [s]
  std::int64_t last_asked_ = max_tick;
  std::size_t consumed_ = 0;  // events up to and including tick now_
  double next_t_ = -1.0;      // of the next event that was looked at, and its tick
  std::int64_t next_tick_ = -1;
  RollbackCounts rollbacks_;
};

}  // namespace sprag
