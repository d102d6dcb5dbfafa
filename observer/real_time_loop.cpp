#include "observer/real_time_loop.h"

#include <algorithm>
#include <cmath>

#include "observer/wake.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr std::size_t strangers_per_turn = 256;
constexpr std::int64_t longest_wait = 2'000'000;  // ns
// Most ticks per turn, so that the loop checks the clock and the messages often enough.
constexpr std::int64_t ticks_per_turn = 4096;
constexpr std::int64_t real_time_lost_after = 100'000'000;  // ns
constexpr std::int64_t silent_after = 1'000'000'000;        // ns
// The run of the machine has ended when its watermark stays the same in this many further messages.
constexpr int messages_at_the_end = 3;
constexpr std::size_t most_new_events = 4096;  // per turn, with measured latency

}  // namespace

RealTimeLoop::RealTimeLoop(Estimation& estimation, std::int64_t last, Freshness freshness,
                           Inbox& inbox, Outbox& outbox, Notices& notices)
    : estimation_(estimation),
      time_line_(estimation.time_line),
      h_(estimation.estimator.h()),
      last_(last),
      inbox_(inbox),
      outbox_(outbox),
      notices_(notices),
      sessions_(freshness, h_) {
  new_events_due_.reserve(most_new_events);
}

void RealTimeLoop::run(const std::atomic<bool>& stop) {
  bool in_time = true;
  status_reported_ = monotonic_now();
  try {
    while (!stop && !done_) turn(in_time);
  } catch (const Interrupted&) {  // a signal; the tick in progress is discarded
  }
  figures_.unsettled_ticks = std::min(reached_, last_) - time_line_.handed_out();
  end_loss(monotonic_now());
  status_.last = true;
  hand_over_status(monotonic_now());
}

void RealTimeLoop::turn(bool& in_time) {
  if (in_time) wait();
  const std::int64_t begin = monotonic_now();
  if (begin - status_reported_ >= health_period) hand_over_status(begin);
  take_messages();
  if (estimation_.stream) take_inputs();
  if (!time_line_.started()) return;
  watch(begin);
  identify();
  in_time = advance(begin);
  watch(monotonic_now());
  account(begin);
  outbox_.ready.signal();
}

// Waits until the next tick is due or a message arrives.
void RealTimeLoop::wait() {
  const std::int64_t latest = monotonic_now() + longest_wait;
  if (!time_line_.started() || !paced()) {
    inbox_.arrived.wait_until(latest);
    return;
  }
  // After the last tick, or while the publishing thread is slower, no tick has a deadline.
  const bool idle =
      time_line_.now() >= last_ || time_line_.handed_out() < time_line_.settled_tick();
  const double next = tick_instant(time_line_.now() + 1, h_).hi;
  inbox_.arrived.wait_until(idle ? latest : std::min(clock_.local(next), latest));
}

void RealTimeLoop::take_messages() {
  take_followed();
  for (std::size_t n = 0; n < strangers_per_turn; ++n) {
    const ReceivedMessage* stranger = inbox_.strangers.front();
    if (stranger == nullptr) break;
    // Earlier messages of the master are in its queue by now. They must be taken first, or its
    // silence would be overestimated.
    take_followed();
    sessions_.note_drop(inbox_.last_drop.load(std::memory_order_acquire));
    take(*stranger);
    inbox_.strangers.pop();
  }
}

// The samples of the followed session. Others are left out; their sender repeats the last ones.
void RealTimeLoop::take_inputs() {
  while (const ReceivedInput* received = inbox_.inputs.front()) {
    if (time_line_.started() && received->message.session == sessions_.session()) {
      last_input_ = received->arrival;
      estimation_.stream->take(received->message);
    }
    inbox_.inputs.pop();
  }
}

void RealTimeLoop::take_followed() {
  while (const ReceivedMessage* received = inbox_.followed.front()) {
    take(*received);
    inbox_.followed.pop();
  }
}

void RealTimeLoop::take(const ReceivedMessage& received) {
  const ContactMessage& message = received.message;
  const MessageCounts before = sessions_.counts();
  switch (sessions_.receive(message, received.arrival)) {
    case SessionTracker::Verdict::ignored:
      report_ignored(received, before);
      return;
    case SessionTracker::Verdict::starts:
      start(received);
      return;
    case SessionTracker::Verdict::resumes:
      resume(received);
      return;
    case SessionTracker::Verdict::continues:
      stands_still_ = message.horizon == last_horizon_ ? stands_still_ + 1 : 0;
      last_horizon_ = message.horizon;
      if (stands_still_ == messages_at_the_end && paced()) {
        announce(Announcement::Kind::end_of_run);
      }
      clock_.observe(message, received.arrival);
      last_received_ = received.arrival.monotonic;
      receive_events(message, sessions_.counts().lost > before.lost, false);
      return;
  }
}

// A new session begins.
void RealTimeLoop::start(const ReceivedMessage& received) {
  const EventCounts events = time_line_.events().counts();
  last_input_ = received.arrival.monotonic;
  estimation_.restart(received.message);
  raise_skipped(time_line_.events(), events, notices_);
  inbox_.session.store(received.message.session, std::memory_order_relaxed);
  inbox_.follows.store(true, std::memory_order_release);
  start_again(received);
  announce(Announcement::Kind::session);
}

// The time line has restarted at this message.
void RealTimeLoop::start_again(const ReceivedMessage& received) {
  clock_.restart();
  clock_.observe(received.message, received.arrival);
  first_received_ = last_received_ = received.arrival.monotonic;
  end_loss(first_received_);
  pace_ = Pace::catching_up;
  stands_still_ = 0;
  last_horizon_ = received.message.horizon;
  reached_ = time_line_.now() - 1;
  corrected_ = false;
}

// The session continues after a jump of its clock or its counts.
void RealTimeLoop::resume(const ReceivedMessage& received) {
  notices_.raise(Notice::resumed, 1, time_line_.events().horizon(), received.message.horizon);
  clock_.restart();
  clock_.observe(received.message, received.arrival);
  last_received_ = received.arrival.monotonic;
  end_loss(last_received_);
  pace_ = Pace::catching_up;
  receive_events(received.message, true, true);
}

void RealTimeLoop::report_ignored(const ReceivedMessage& received, const MessageCounts& before) {
  const ContactMessage& message = received.message;
  const MessageCounts& now = sessions_.counts();
  if (now.stale > before.stale) {
    notices_.raise(Notice::stale, 1,
                   1e-6 * static_cast<double>(delay(message.utime, received.arrival)));
  }
  if (before.of_other_masters == 0 && now.of_other_masters > 0) {
    announce(Announcement::Kind::other_master);
  }
  raise_odd(sessions_.oddity(), message, time_line_.events().horizon(), notices_);
}

void RealTimeLoop::receive_events(const ContactMessage& message, bool after_a_loss, bool resumed) {
  std::size_t known = time_line_.events().events().size();
  const std::int64_t present = time_line_.now();
  const EventCounts before = time_line_.events().counts();
  const bool again = estimation_.receive(message, resumed);
  raise_skipped(time_line_.events(), before, notices_);
  const auto& events = time_line_.events().events();
  if (again) {
    known = events.size();
    reached_ = time_line_.now() - 1;
    first_received_ = last_received_;
    announce(Announcement::Kind::session);
  }
  for (std::size_t i = known; i < events.size(); ++i) {
    if (first_tick_after(events[i].t, h_) <= present) ++figures_.late_events;
  }
  if (after_a_loss) {
    figures_.repaired_events += static_cast<std::int64_t>(events.size() - known);
  }
  if (!paced()) return;
  for (std::size_t i = known; i < events.size() && new_events_due_.size() < most_new_events; ++i) {
    new_events_due_.push_back(clock_.local(events[i].t));
  }
}

bool RealTimeLoop::paced() const { return !std::isinf(clock_.speed()); }

// The machine's time has ended: no tick is late then, and silence is expected.
bool RealTimeLoop::at_end() const { return stands_still_ >= messages_at_the_end && paced(); }

// Advances to the due tick; false if that takes more than one turn. The provisional ticks are sent
// before the settled ones, so that a new event is in an estimate as soon as possible.
bool RealTimeLoop::advance(std::int64_t now) {
  const std::int64_t target = std::min(tick_for_now(now), last_);
  const auto on_reached = [this](const State& state) { on_tick(state); };
  time_line_.run(
      target, on_reached, [](const State&) { return false; }, ticks_per_turn);
  repeat_corrected();
  outbox_.ready.signal();
  const bool in_time = time_line_.run(
      target, on_reached, [this](const State& state) { return on_settled(state); }, ticks_per_turn);
  repeat_corrected();
  if (time_line_.handed_out() >= last_) done_ = true;
  return in_time;
}

// The due tick, or the next one if the last event lies between the two: that estimate is early by
// less than a tick.
std::int64_t RealTimeLoop::tick_for_now(std::int64_t now) const {
  const double simulated = clock_.simulated(now);
  const std::int64_t due = simulated > 0.0 ? last_tick(simulated, h_) : 0;
  return std::max(due, std::min(time_line_.tick_of_last_event(), due + 1));
}

void RealTimeLoop::on_tick(const State& state) {
  if (state.tick > last_) return;
  reached_ = state.tick;
  status_.simulated += h_;
  corrected_ = false;
  if (paced() && !at_end()) {
    const std::int64_t due = clock_.local(tick_instant(state.tick, h_).hi);
    if (due > first_received_) {
      const std::int64_t late = monotonic_now() - due;
      figures_.lateness.add(late);
      status_.lateness.add(late);
      const double tick = 1e9 * h_ / clock_.speed();
      if (static_cast<double>(late) > tick) ++figures_.missed;
    }
  }
  if (!send(false, state)) ++figures_.estimates_dropped;
}

bool RealTimeLoop::on_settled(const State& state) {
  if (follower_ != nullptr && !hand_over_events()) return false;
  return state.tick > last_ || send(true, state);
}

// Hands over all events and the horizon; false if the queue has no room for all of them yet.
bool RealTimeLoop::hand_over_events() {
  const EventHistory& history = time_line_.events();
  const auto& all = history.events();
  const auto taken = history.counts().events;
  if (reported_start_ != time_line_.starts()) {
    if (!follower_->put({.kind = Settled::Kind::start,
                         .tick = time_line_.first_tick(),
                         .session = sessions_.session(),
                         .chi = time_line_.first_closed()})) {
      return false;
    }
    reported_horizon_ = no_horizon;
    reported_start_ = time_line_.starts();
    reported_events_ = taken - static_cast<std::int64_t>(all.size());
  }
  for (; reported_events_ < taken; ++reported_events_) {
    const ContactEvent& event =
        all[all.size() - static_cast<std::size_t>(taken - reported_events_)];
    if (!follower_->put({.kind = Settled::Kind::event, .event = event})) return false;
  }
  if (history.horizon() > reported_horizon_) {
    if (!follower_->put({.kind = Settled::Kind::horizon, .horizon = history.horizon()})) {
      return false;
    }
    reported_horizon_ = history.horizon();
  }
  return true;
}

// Settled ticks wait for identifications; provisional ticks do not.
void RealTimeLoop::identify() {
  if (identification_ == nullptr) return;
  const AdaptationResult* result = identification_->result();
  // A restart of the time line makes a running task void.
  if (result != nullptr && asked_ == time_line_.starts()) time_line_.finish(*result);
  if (result != nullptr) asked_ = 0;
  const bool due = time_line_.waits() && time_line_.handed_out() < last_;
  if (due && asked_ != time_line_.starts() && identification_->ask(time_line_.task())) {
    asked_ = time_line_.starts();
  }
}

// After a rollback the last tick reached is sent once more.
void RealTimeLoop::repeat_corrected() {
  if (time_line_.rollbacks().rollbacks > corrected_rollbacks_) corrected_ = true;
  corrected_rollbacks_ = time_line_.rollbacks().rollbacks;
  if (!corrected_ || time_line_.now() < reached_ || reached_ > last_) return;
  corrected_ = false;
  if (paced() && !send(false, time_line_.present())) ++figures_.estimates_dropped;
}

bool RealTimeLoop::send(bool settled, const State& state) {
  Sample* slot = outbox_.samples.free_slot();
  if (slot == nullptr) return false;
  slot->settled = settled;
  estimation_.describe(state, settled, slot->estimate);
  slot->estimate.session = sessions_.session();
  slot->estimate.settled_tick =
      std::max<std::int64_t>(settled ? state.tick : time_line_.handed_out(), -1);
  outbox_.samples.push();
  return true;
}

// Checks whether the estimate keeps up with the master, and whether the master still sends.
void RealTimeLoop::watch(std::int64_t now) {
  if (!paced() || at_end()) return;
  const double next = tick_instant(reached_ + 1, h_).hi;
  const std::int64_t lag = reached_ >= last_ ? 0 : now - clock_.local(next);
  if (lag > real_time_lost_after && pace_ == Pace::kept) {
    pace_ = Pace::lost;
    lost_since_ = now - lag;
    ++figures_.real_time_losses;
    announce(Announcement::Kind::real_time_lost);
  } else if (lag <= longest_wait) {
    if (pace_ == Pace::lost) announce(Announcement::Kind::real_time_regained);
    end_loss(now);
    pace_ = Pace::kept;
  }
  if (pace_ != Pace::kept) return;
  const std::int64_t received =
      std::max(last_received_, inbox_.last_arrival.load(std::memory_order_relaxed));
  const bool silent = now - received > silent_after;
  if (silent && !silent_) announce(Announcement::Kind::silence);
  silent_ = silent;
  if (!estimation_.stream) return;
  const bool input_silent = now - last_input_ > silent_after;
  if (input_silent != input_silent_) {
    announce(input_silent ? Announcement::Kind::input_silence : Announcement::Kind::input_regained);
  }
  input_silent_ = input_silent;
}

void RealTimeLoop::end_loss(std::int64_t now) {
  if (pace_ == Pace::lost) figures_.real_time_lost += now - lost_since_;
  pace_ = Pace::catching_up;
}

void RealTimeLoop::account(std::int64_t begin) {
  const std::int64_t end = monotonic_now();
  figures_.execution.add(end - begin);
  const std::int64_t rollbacks = time_line_.rollbacks().rollbacks;
  if (rollbacks > rollbacks_) figures_.rollback_cost.add(end - begin);
  rollbacks_ = rollbacks;
  for (const std::int64_t due : new_events_due_) {
    figures_.event_latency.add(end - due);
    status_.event_latency.add(end - due);
  }
  new_events_due_.clear();
}

// Hands over the status of the period. If the queue is full, the period continues.
void RealTimeLoop::hand_over_status(std::int64_t now) {
  IntegrationStatus* slot = outbox_.statuses.free_slot();
  if (slot == nullptr) return;
  const bool started = time_line_.started();
  // Only messages of the followed session count here.
  const bool silent = now - last_received_ > silent_after;
  const EventCounts& events = time_line_.events().counts();
  health_t& health = status_.health;
  const auto master = !started   ? MasterState::awaited
                      : at_end() ? MasterState::ended
                      : silent   ? MasterState::silent
                                 : MasterState::received;
  health.master = static_cast<std::int8_t>(master);
  if (estimation_.stream) {
    const bool input_silent = now - last_input_ > silent_after || !estimation_.stream->started();
    health.input =
        static_cast<std::int8_t>(input_silent ? InputState::silent : InputState::received);
  }
  health.session = sessions_.session();
  health.tick = reached_;
  health.t = reached_ < 0 ? -1.0 : tick_instant(reached_, h_).hi;
  health.speed = started ? clock_.speed() : 0.0;
  health.period = 1e-9 * static_cast<double>(now - status_reported_);
  if (health.period > 0.0) health.real_time_factor = status_.simulated / health.period;
  health.deadlines = figures_.lateness.count();
  health.missed_deadlines = figures_.missed;
  health.real_time_losses = figures_.real_time_losses;
  health.events = events.events;
  health.late_events = figures_.late_events;
  health.lost_events = events.lost_records;
  health.gaps = static_cast<std::int64_t>(time_line_.events().degraded().size());
  health.skipped_events = all_skipped(events);
  health.rollbacks = time_line_.rollbacks().rollbacks;
  status_.messages = sessions_.counts();
  *slot = status_;
  outbox_.statuses.push();
  outbox_.ready.signal();
  status_reported_ = now;
  status_.begin_period();
}

// Hands the announcement to the publishing thread, which prints it.
void RealTimeLoop::announce(Announcement::Kind kind) {
  Announcement* slot = outbox_.announcements.free_slot();
  if (slot == nullptr) return;
  slot->kind = kind;
  slot->session =
      kind == Announcement::Kind::other_master ? sessions_.other() : sessions_.session();
  // A time line that starts has not reached its first tick yet.
  const std::int64_t tick = kind == Announcement::Kind::session ? time_line_.now() : reached_;
  slot->t = tick_instant(std::max<std::int64_t>(tick, 0), h_).hi;
  outbox_.announcements.push();
}

}  // namespace sprag
