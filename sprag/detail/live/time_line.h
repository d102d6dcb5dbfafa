// Time line of the observer. Ticks are at t_k = k h of simulated time. The estimator runs ahead to
// "now". An event older than now causes a rollback to the last tick before it and a re-integration,
// so that every tick is as if the event had arrived in time. Ticks up to the horizon (all events
// known) are settled: they are returned once, in order, and depend on the events alone. The history
// of saved states always includes the last settled tick, so that an event older than the history
// costs time but no accuracy. Independent of clocks and transport. Only the constructor allocates.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "sprag/detail/events/event_history.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/histogram.h"
#include "sprag/detail/live/machine_adaptation.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/model.h"

namespace sprag {

struct RollbackCounts {
  std::int64_t rollbacks = 0;
  std::int64_t ticks_redone = 0;
  std::int64_t beyond_history = 0;  ///< rollbacks beyond the history, to the last settled tick
  Histogram depth;                  ///< ticks redone by each rollback
};

class TimeLine {
 public:
  /// Keeps the states of at least `history` ticks (>= 1) for rollbacks.
  TimeLine(TrackingEstimator& estimator, int contacts, const State& start, std::int64_t history);

  /// Starts at tick k; earlier events have no effect.
  void restart(std::int64_t k, std::int64_t next_record, ContactSet chi, double horizon);

  /// Starts from the first message of a session: at t = 0 if the message still has every event
  /// since then and its horizon is not far, else at the first tick after its horizon. A machine's
  /// clock may start at any time.
  void restart(const ContactMessage& message);

  /// Starts at the first tick after the message's horizon.
  void restart_after(const ContactMessage& message);

  /// Takes the new records of a message, and rolls back if they are older than now; run()
  /// integrates again. After a long gap with lost records it restarts at the first tick after the
  /// message's horizon and returns true.
  bool receive(const ContactMessage& message);

  /// The same after a jump of the machine's clock or counts: also restarts if the message does not
  /// continue the earlier ones or is far ahead of them.
  bool resume(const ContactMessage& message);

  /// Takes one event from a file.
  void receive(const ContactEvent& event);

  /// The streamed input is known before t; -1: no sample is known. Ticks settle before t only.
  /// Ticks from `from` on [s] were computed without it, and are computed again.
  void receive_input(double from, double t);

  /// Every event up to t is known.
  void set_horizon(double t) { events_.set_horizon(t); }

  /// Ticks settle when every event up to `lag` [s] after them is known. Once every event up to tick
  /// `last` is known, the lag no longer applies: no later tick is requested.
  void set_lag(double lag, std::int64_t last = max_tick);

  /// Events may be missing between these times.
  void degrade(double from, double to) { events_.degrade(from, to); }

  /// Whether the last returned tick of an adaptive estimator has requested the identification of
  /// task(). No later tick settles until finish() or a restart; run() still moves through later
  /// ticks.
  bool waits() const { return waits_; }
  const AdaptationTask& task() const { return adaptation_->task(); }
  /// Takes the result of task(). The ticks after the last returned one are computed again.
  void finish(const AdaptationResult& result);
  /// If waits(): identifies at once, takes the result and returns true. Allocates. Throws
  /// Interrupted (interrupt.h).
  bool identify();

  /// Rolls back to tick k, or to the last returned tick if that is later. Changes no estimate.
  void go_back_to(std::int64_t k);

  /// Runs to tick `target`, or to the horizon if that is later, by at most `budget` ticks. Returns
  /// whether it arrived. Calls on_tick(state) for every tick reached for the first time and
  /// on_settled(state) for every settled tick, once and in order. on_settled() may return false to
  /// get the tick again at the next call; the time line then waits.
  template <typename OnTick, typename OnSettled>
  bool run(std::int64_t target, OnTick&& on_tick, OnSettled&& on_settled,
           std::int64_t budget = std::numeric_limits<std::int64_t>::max()) {
    if (!started_) return true;
    // No event arrives during run(), but a settled tick may request an identification.
    const std::int64_t known = known_tick();
    const auto settled = [&] { return waits_ ? handed_out_ : known; };
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
        if (adaptation_) waits_ = adaptation_->settle(events_at(handed_out_), saved(handed_out_));
      }
      arrived = now_ >= std::max(target, settled());
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

  /// Skips ticks of free flight before the next event, up to tick `last`, for callers that use only
  /// note() of settled ticks. The skipped ticks count as returned. Requires that all ticks up to
  /// now have been returned. Returns the number of skipped ticks, at most most_coasted.
  std::int64_t coast(std::int64_t last) {
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
  std::int64_t now() const { return now_; }
  /// Number of starts; tick and chi of the last start.
  std::int64_t starts() const { return starts_; }
  std::int64_t first_tick() const { return first_; }
  ContactSet first_closed() const { return chi_; }
  /// The state at tick now().
  const TrackingState& present() const { return saved(now_); }
  /// First tick that contains all known events.
  std::int64_t tick_of_last_event() const {
    return events_.events().empty() ? first_ : tick_of(events_.events().back());
  }
  /// Last settled tick: at or before the horizon, and the last returned one if that waits();
  /// first_tick() - 1 if there is none.
  std::int64_t settled_tick() const { return waits_ ? handed_out_ : known_tick(); }
  /// Last tick returned by on_settled().
  std::int64_t handed_out() const { return handed_out_; }
  const EventHistory& events() const { return events_; }
  const RollbackCounts& rollbacks() const { return rollbacks_; }

 private:
  static constexpr std::int64_t no_tick = -2;
  static constexpr std::size_t event_capacity = 1U << 16U;
  // Largest number of ticks to integrate at a start or after a gap, some tenths of a second.
  static constexpr std::int64_t far = 100'000;
  // Limits the time to milliseconds with a large machine.
  static constexpr std::int64_t most_coasted = 16'384;

  // Last tick up to which every event is known.
  std::int64_t received_tick() const {
    if (events_.horizon() < 0.0 || input_horizon_ < 0.0) return first_ - 1;
    // The last tick before the input's horizon.
    const std::int64_t before_input =
        std::isinf(input_horizon_) ? max_tick : first_tick_after(input_horizon_, h()) - 1;
    return std::max(std::min(last_tick(events_.horizon(), h()), before_input), first_ - 1);
  }
  // The same with `lag_`.
  std::int64_t known_tick() const {
    const std::int64_t received = received_tick();
    if (lag_ == 0.0 || received >= last_asked_ || received < first_) return received;
    const double waited = std::min(events_.horizon(), input_horizon_) - lag_;
    return waited < 0.0 ? first_ - 1 : std::max(last_tick(waited, h()), first_ - 1);
  }
  bool is_far(double horizon) const { return last_tick(horizon, h()) - received_tick() > far; }

  TrackingState& saved(std::int64_t k) { return saved_[slot(k)]; }
  const TrackingState& saved(std::int64_t k) const { return saved_[slot(k)]; }
  std::size_t slot(std::int64_t k) const {
    const std::size_t slot = oldest_slot_ + static_cast<std::size_t>(k - oldest_);
    return slot < saved_.size() ? slot : slot - saved_.size();
  }

  // First tick at or after the event.
  std::int64_t tick_of(const ContactEvent& event) const {
    return std::max(first_tick_after(event.t, h()), first_);
  }

  // The known events of tick k.
  std::span<const ContactEvent> events_at(std::int64_t k) const;

  // Tick of the event at `consumed_`.
  std::int64_t next_event_tick() {
    const auto& all = events_.events();
    if (consumed_ == all.size()) return std::numeric_limits<std::int64_t>::max();
    if (all[consumed_].t != next_t_) {
      next_t_ = all[consumed_].t;
      next_tick_ = tick_of(all[consumed_]);
    }
    return next_tick_;
  }

  // Takes the events of one tick, from `consumed_` on.
  std::span<const ContactEvent> events_of(std::int64_t k) {
    if (next_event_tick() != k) return {};
    const auto& all = events_.events();
    std::size_t end = consumed_ + 1;
    while (end < all.size() && tick_of(all[end]) == k) ++end;
    const std::span<const ContactEvent> events(all.data() + consumed_, end - consumed_);
    consumed_ = end;
    return events;
  }

  void start_again();

  void step();

  // Step without saving the present tick, to which no rollback will go.
  void step_in_place() {
    oldest_slot_ = slot(now_);
    oldest_ = ++now_;
    estimator_->tick(events_of(now_), saved(now_));
  }

  // Rolls back to the last tick before the event with the index `first_new`.
  void go_back(std::size_t first_new);

  // Makes the state at tick k >= handed_out_ the present one, or an earlier state if that is not
  // kept.
  void redo_after(std::int64_t k);

  // Drops events of returned ticks, except those of the first tick, which start_again() needs.
  void forget();

  TrackingEstimator* estimator_;
  State start_;
  std::int64_t history_;
  EventHistory events_;
  std::vector<TrackingState> saved_;  // ring, of the ticks from oldest_ to now_
  std::size_t oldest_slot_ = 0;
  // State at handed_out_ if that is older than oldest_.
  TrackingState frontier_;
  std::int64_t frontier_tick_ = no_tick;
  bool started_ = false;
  std::int64_t starts_ = 0;
  ContactSet chi_ = 0;  // at the first tick
  std::int64_t first_ = 0;
  std::int64_t oldest_ = 0;
  std::int64_t now_ = 0;
  std::int64_t reached_ = -1;
  std::int64_t handed_out_ = -1;
  std::optional<MachineAdaptation> adaptation_;
  bool waits_ = false;  // for an identification: set by the settled tick that requests it
  double lag_ = 0.0;    // [s]
  double input_horizon_ = std::numeric_limits<double>::infinity();
  std::int64_t last_asked_ = max_tick;
  std::size_t consumed_ = 0;  // number of events up to and including tick now_
  double next_t_ = -1.0;      // time and tick of the next event, cached
  std::int64_t next_tick_ = -1;
  RollbackCounts rollbacks_;
};

}  // namespace sprag
