#include "observer/live.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <thread>

#include "command_line/program.h"
#include "lcmtypes/big_endian.h"
#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "lcmtypes/state_codec.h"
#include "observer/confidence_record.h"
#include "observer/figures.h"
#include "observer/flow_builder.h"
#include "observer/master_clock.h"
#include "observer/notices.h"
#include "observer/real_time.h"
#include "observer/report.h"
#include "observer/session_tracker.h"
#include "observer/spsc_queue.h"
#include "observer/thread_group.h"
#include "observer/wake.h"
#include "sprag/estimation/time_line.h"
#include "sprag/files/states_file.h"
#include "sprag/mechanics/interrupt.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t report_slots = 1024;
constexpr std::size_t strangers_per_turn = 256;
constexpr std::size_t most_sample_slots = 16384;
constexpr std::size_t least_sample_slots = 1024;
constexpr std::size_t sample_bytes = 8 << 20;
constexpr std::int64_t max_history_bytes = 256 << 20;
constexpr int last_sample_repeats = 5;
constexpr std::int64_t longest_wait = 2'000'000;         // ns
constexpr std::int64_t progress_period = 1'000'000'000;  // ns
// The loop looks at the clock and at the messages at least as often as this.
constexpr std::int64_t ticks_per_turn = 4096;
constexpr std::int64_t real_time_lost_after = 100'000'000;  // ns
constexpr std::int64_t silent_after = 1'000'000'000;        // ns
constexpr std::int64_t longest_queued = 60'000'000;         // us, of a message in the kernel
// Messages in a row whose horizon stays: the machine's time has come to its end.
constexpr int messages_at_the_end = 3;
constexpr std::size_t most_new_events = 4096;  // per turn, whose latency is taken
constexpr int receiving_priority = 79, integrating_priority = 80, publishing_priority = 70;

struct Heard {
  ContactReport report;
  Arrival arrival;
};

struct Sample {
  enum class Kind {
    estimate,
    settled,
    session,
    other_master,
    silence,
    end_of_run,
    real_time_lost,
    real_time_regained
  } kind = Kind::estimate;
  EstimateSample estimate;
};

std::int64_t history_ticks(const Scene& scene, const ObserverOptions& options) {
  const double wanted = std::ceil(options.history / options.tick);
  const std::int64_t bytes = 1024 + 64 * scene.model.coordinates();
  const std::int64_t most = std::max<std::int64_t>(16, max_history_bytes / bytes);
  return wanted < static_cast<double>(most) ? std::max<std::int64_t>(16, std::llround(wanted))
                                            : most;
}

std::size_t sample_slots(const Scene& scene) {
  const auto numbers =
      4 * scene.model.coordinates() + static_cast<Eigen::Index>(scene.model.contacts.size());
  const std::size_t bytes = sizeof(Sample) + sizeof(double) * static_cast<std::size_t>(numbers);
  return std::clamp(sample_bytes / bytes, least_sample_slots, most_sample_slots);
}

using Kind = Sample::Kind;

Notice notice_of(Refusal refusal) {
  switch (refusal) {
    case Refusal::wrong_type:
      return Notice::wrong_type;
    case Refusal::truncated:
    case Refusal::oversized:
      return Notice::wrong_size;
    case Refusal::bad_contact:
      return Notice::bad_contact;
    case Refusal::bad_kind:
      return Notice::bad_kind;
    case Refusal::bad_closed:
      return Notice::bad_closed;
    case Refusal::bad_time:
      return Notice::bad_time;
    case Refusal::bad_speed:
      return Notice::bad_speed;
    default:
      return Notice::bad_count;
  }
}

// Of a message that may be anything; 0 if it is too short.
std::int64_t session_of(std::span<const std::uint8_t> data) {
  if (data.size() < 16) return 0;
  const std::uint8_t* from = data.data() + 8;
  return take<std::int64_t>(from);
}

template <typename Stepper>
class LiveObserver {
 public:
  LiveObserver(const Scene& scene, const ObserverOptions& options, const CommonOptions& common)
      : contacts_(static_cast<int>(scene.model.contacts.size())),
        coordinates_(scene.model.coordinates()),
        initial_bound_(initial_bound(scene)),
        real_time_(options.real_time),
        stepper_(make_stepper<Stepper>(scene, options.tick)),
        time_line_(stepper_, contacts_, scene.replica, history_ticks(scene, options)),
        duration_(options.duration),
        last_(std::isinf(options.duration) ? std::numeric_limits<std::int64_t>::max()
                                           : last_tick(options.duration, options.tick)),
        sessions_(common.key.empty() ? Freshness::any : Freshness::required, options.tick),
        heard_(report_slots, Heard{}),
        strangers_(report_slots, Heard{}),
        samples_(sample_slots(scene), empty_sample()),
        bus_(common.url, key_of(common)) {
    new_events_due_.reserve(most_new_events);
    if (!options.states.empty()) {
      states_.emplace(options.states, coordinates_,
                      confidence_columns(empty_sample().estimate.confidence, initial_bound_));
      if (!states_->good()) throw std::runtime_error(states_->error());
    }
    bus_.subscribe(contacts_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                            std::int64_t utime) { hear(data, utime); });
    if constexpr (requires { stepper_.flows(); }) flow_builder_.emplace(stepper_.flows());
    if (real_time_) claim_real_time();
    std::cerr << "listening on " << common.url << '\n';
  }

  /// Until the run is over, or a thread has failed; then finish() says so.
  void run() {
    threads_.run([this] {
      threads_.start([this] { receive(); });
      if (flow_builder_) threads_.start([this] { flow_builder_->run(); });
      threads_.start([this] { integrate(); });
      publish();
    });
    threads_.end();
    threads_.run([this] {
      emit_all();
      repeat_last();
      notices_.tell_rest(std::cerr);
    });
  }

  /// Fills the report and closes the files. Throws what a thread has thrown, or a file's error.
  void finish(nlohmann::ordered_json& report) {
    figures_.messages = sessions_.counts();
    figures_.rollbacks = time_line_.rollbacks();
    figures_.events = time_line_.events().counts();
    figures_.reception.bus = bus_.counts();
    to_json(figures_, report);
    report["settled_tick"] = time_line_.handed_out();
    report["flow_path"] = flow_path(stepper_);
    report["flows_awaited"] = flow_builder_ ? flow_builder_->awaited() : 0;
    record_.to_json(report);
    report.update(to_json(time_line_.events()));
    for (const DegradedInterval& gap : time_line_.events().degraded()) {
      std::cerr << "events may be missing between t = " << gap.from << " and " << gap.to << '\n';
    }
    print(figures_, std::cerr);
    record_.print(std::cerr);
    const bool states_good = !states_ || states_->close();
    rethrow();
    if (!states_good) throw std::runtime_error(states_->error());
  }

 private:
  // Whatever it is, the input was good enough to start with: the run has failed.
  void rethrow() const {
    try {
      threads_.rethrow();
    } catch (const std::exception& e) {
      throw std::runtime_error(e.what());
    }
  }

  void stop() {
    stop_ = true;
    if (flow_builder_) flow_builder_->stop();
    reports_arrived_.signal();
    samples_ready_.signal();
  }

  Sample empty_sample() const {
    Sample sample;
    sample.estimate.q.setZero(coordinates_);
    sample.estimate.u.setZero(coordinates_);
    sample.estimate.confidence = empty_confidence<Stepper>(coordinates_, contacts_);
    return sample;
  }

  // Says in one line what is not granted, and goes on without it.
  void claim_real_time() {
    std::string refused = lock_memory();
    // The threads claim their own priorities; whether they may is known here.
    if (refused.empty()) refused = schedule_fifo(publishing_priority);
    if (refused.empty()) return;
    std::cerr << "no real-time scheduling (" << refused << "): running without it\n";
    real_time_ = false;
  }

  void prepare_thread(int priority) const {
    sleep_exactly();
    if (real_time_) (void)schedule_fifo(priority);
  }

  // Receiving thread.
  void receive() {
    prepare_thread(receiving_priority);
    while (!stop_) {
      bus_.handle(50ms);
      tell_refused();
    }
  }

  void hear(std::span<const std::uint8_t> data, std::int64_t utime) {
    const Arrival arrival = arrival_of(utime);
    last_arrival_.store(arrival.monotonic, std::memory_order_relaxed);
    if (bus_.counts().overflowed > kernel_drops_) {
      kernel_drops_ = bus_.counts().overflowed;
      last_drop_ = arrival.monotonic;
    }
    // Who is followed has a queue of its own, so that others cannot fill it.
    const bool followed = follows_.load(std::memory_order_acquire) &&
                          session_of(data) == followed_.load(std::memory_order_relaxed);
    SpscQueue<Heard>& queue = followed ? heard_ : strangers_;
    Heard* slot = queue.free_slot();
    if (slot == nullptr) {
      ++figures_.reception.overflowed;
      if (followed) {
        last_drop_ = arrival.monotonic;
      } else {
        notices_.raise(Notice::crowded);
      }
      return;
    }
    slot->arrival = arrival;
    const Refusal refusal = decode(data, slot->report);
    if (refusal != Refusal::none) {
      ++figures_.reception.refused[static_cast<std::size_t>(refusal)];
      notices_.raise(notice_of(refusal));
    } else if (slot->report.contacts != contacts_) {
      ++figures_.reception.other_machine;
      notices_.raise(Notice::other_machine, 1, slot->report.contacts, contacts_);
    } else {
      queue.push();
      // Strangers are looked at in the turns that there are anyway.
      if (followed || !follows_.load(std::memory_order_relaxed)) reports_arrived_.signal();
    }
  }

  // By the clocks of this host, when the kernel took it: it may have waited since.
  static Arrival arrival_of(std::int64_t utime) {
    const std::int64_t wall = wall_clock_us();
    const std::int64_t queued =
        wall - utime >= 0 && wall - utime <= longest_queued ? wall - utime : 0;
    return {monotonic_now() - 1000 * queued, wall - queued};
  }

  // What the bus has kept away.
  void tell_refused() {
    const BusCounts& counts = bus_.counts();
    const auto fault = [&counts](PacketFault of) {
      return counts.faults[static_cast<std::size_t>(of)];
    };
    tell_rise(Notice::malformed, fault(PacketFault::foreign) + fault(PacketFault::no_channel));
    tell_rise(Notice::fragment, fault(PacketFault::fragment));
    tell_rise(Notice::other_host, counts.other_host);
    if (tell_rise(Notice::unauthenticated, counts.unauthenticated)) {
      last_arrival_.store(monotonic_now(), std::memory_order_relaxed);
    }
  }

  bool tell_rise(Notice notice, std::int64_t count) {
    std::int64_t& before = kept_away_[static_cast<std::size_t>(notice)];
    if (count == before) return false;
    notices_.raise(notice, count - before);
    before = count;
    return true;
  }

  // Integrating thread: the real-time loop.
  void integrate() {
    prepare_thread(integrating_priority);
    bool in_time = true;
    try {
      while (!stop_ && !done_) turn(in_time);
    } catch (const Interrupted&) {  // a signal; nothing of the tick under way is handed out
    }
    figures_.integration.unsettled_ticks = std::min(reached_, last_) - time_line_.handed_out();
    end_loss(monotonic_now());
    samples_ready_.signal();
  }

  void turn(bool& in_time) {
    if (in_time) wait();
    const std::int64_t begin = monotonic_now();
    take_reports();
    if (!time_line_.started()) return;
    watch(begin);
    in_time = advance(begin);
    watch(monotonic_now());
    account(begin);
    samples_ready_.signal();
  }

  // Until the next tick is due, or something is heard.
  void wait() {
    const std::int64_t latest = monotonic_now() + longest_wait;
    if (!time_line_.started() || std::isinf(clock_.speed())) {
      reports_arrived_.wait_until(latest);
      return;
    }
    // Past the last tick, or while the publishing thread is behind, there is nothing to be late
    // for.
    const bool idle =
        time_line_.now() >= last_ || time_line_.handed_out() < time_line_.settled_tick();
    const double next = tick_instant(time_line_.now() + 1, stepper_.h()).hi;
    reports_arrived_.wait_until(idle ? latest : std::min(clock_.local(next), latest));
  }

  void take_reports() {
    take_followed();
    for (std::size_t n = 0; n < strangers_per_turn; ++n) {
      const Heard* stranger = strangers_.front();
      if (stranger == nullptr) break;
      // What the master sent before this one is here by now: only then does its silence count.
      take_followed();
      sessions_.note_drop(last_drop_.load(std::memory_order_acquire));
      take(*stranger);
      strangers_.pop();
    }
  }

  void take_followed() {
    while (const Heard* heard = heard_.front()) {
      take(*heard);
      heard_.pop();
    }
  }

  void take(const Heard& heard) {
    const ContactReport& report = heard.report;
    const MessageCounts before = sessions_.counts();
    switch (sessions_.hear(report, heard.arrival)) {
      case SessionTracker::Verdict::ignored:
        tell_ignored(heard, before);
        return;
      case SessionTracker::Verdict::starts: {
        const EventCounts events = time_line_.events().counts();
        time_line_.restart(report);
        raise_skipped(time_line_.events(), events, notices_);
        followed_.store(report.session, std::memory_order_relaxed);
        follows_.store(true, std::memory_order_release);
        start_again(heard);
        announce(Kind::session);
        return;
      }
      case SessionTracker::Verdict::resumes:
        notices_.raise(Notice::resumed, 1, time_line_.events().horizon(), report.horizon);
        clock_.restart();
        clock_.observe(report, heard.arrival);
        last_heard_ = heard.arrival.monotonic;
        end_loss(last_heard_);
        pace_ = Pace::catching_up;
        receive_events(report, true, true);
        return;
      case SessionTracker::Verdict::continues:
        stands_still_ = report.horizon > time_line_.events().horizon() ? 0 : stands_still_ + 1;
        if (stands_still_ == messages_at_the_end && paced()) announce(Kind::end_of_run);
        clock_.observe(report, heard.arrival);
        last_heard_ = heard.arrival.monotonic;
        receive_events(report, sessions_.counts().lost > before.lost, false);
        return;
    }
  }

  // The time line has started at this report.
  void start_again(const Heard& heard) {
    clock_.restart();
    clock_.observe(heard.report, heard.arrival);
    first_heard_ = last_heard_ = heard.arrival.monotonic;
    end_loss(first_heard_);
    pace_ = Pace::catching_up;
    stands_still_ = 0;
    reached_ = time_line_.now() - 1;
    corrected_ = false;
  }

  void tell_ignored(const Heard& heard, const MessageCounts& before) {
    const ContactReport& report = heard.report;
    const MessageCounts& now = sessions_.counts();
    if (now.stale > before.stale) {
      notices_.raise(Notice::stale, 1,
                     1e-6 * static_cast<double>(delay(report.utime, heard.arrival)));
    }
    if (before.of_other_masters == 0 && now.of_other_masters > 0) announce(Kind::other_master);
    raise_odd(sessions_.oddity(), report, time_line_.events().horizon(), notices_);
  }

  void receive_events(const ContactReport& report, bool behind_a_loss, bool resumed) {
    std::size_t known = time_line_.events().events().size();
    const EventCounts before = time_line_.events().counts();
    const bool again = resumed ? time_line_.resume(report) : time_line_.receive(report);
    raise_skipped(time_line_.events(), before, notices_);
    const auto& events = time_line_.events().events();
    if (again) {
      known = events.size();
      reached_ = time_line_.now() - 1;
      first_heard_ = last_heard_;
      announce(Kind::session);
    }
    if (behind_a_loss) {
      figures_.integration.repaired_events += static_cast<std::int64_t>(events.size() - known);
    }
    if (!paced()) return;
    for (std::size_t i = known; i < events.size() && new_events_due_.size() < most_new_events;
         ++i) {
      new_events_due_.push_back(clock_.local(events[i].t));
    }
  }

  bool paced() const { return !std::isinf(clock_.speed()); }

  // The machine says that its time has come to an end: nothing is late then, and silence is no
  // news.
  bool at_end() const { return stands_still_ >= messages_at_the_end && paced(); }

  // Runs to the tick that is due; false if there was more to do than a turn may take. What is for
  // now goes out first: then an event that was taken is in an estimate at once.
  bool advance(std::int64_t now) {
    const std::int64_t target = std::min(tick_for_now(now), last_);
    const auto on_reached = [this](const auto& state) { on_tick(state); };
    time_line_.run(
        target, on_reached, [](const auto&) { return false; }, ticks_per_turn);
    repeat_corrected();
    samples_ready_.signal();
    const bool in_time = time_line_.run(
        target, on_reached, [this](const auto& state) { return on_settled(state); },
        ticks_per_turn);
    repeat_corrected();
    if (time_line_.handed_out() >= last_) done_ = true;
    return in_time;
  }

  // The tick that is due; the one behind it where an event falls between the two: it is not late
  // then, but early by less than a tick.
  std::int64_t tick_for_now(std::int64_t now) const {
    const double simulated = clock_.simulated(now);
    const std::int64_t due = simulated > 0.0 ? last_tick(simulated, stepper_.h()) : 0;
    return std::max(due, std::min(time_line_.tick_of_last_event(), due + 1));
  }

  // After going back the last tick reached goes out again, once.
  void repeat_corrected() {
    if (time_line_.rollbacks().rollbacks > corrected_rollbacks_) corrected_ = true;
    corrected_rollbacks_ = time_line_.rollbacks().rollbacks;
    if (!corrected_ || time_line_.now() < reached_ || reached_ > last_) return;
    corrected_ = false;
    if (paced() && !send(Kind::estimate, time_line_.present())) {
      ++figures_.integration.estimates_dropped;
    }
  }

  // Whether the estimate keeps up with the master, and whether the master is still there.
  void watch(std::int64_t now) {
    if (!paced() || at_end()) return;
    const double next = tick_instant(reached_ + 1, stepper_.h()).hi;
    const std::int64_t lag = reached_ >= last_ ? 0 : now - clock_.local(next);
    if (lag > real_time_lost_after && pace_ == Pace::kept) {
      pace_ = Pace::lost;
      lost_since_ = now - lag;
      ++figures_.integration.real_time_losses;
      announce(Kind::real_time_lost);
    } else if (lag <= longest_wait) {
      if (pace_ == Pace::lost) announce(Kind::real_time_regained);
      end_loss(now);
      pace_ = Pace::kept;
    }
    if (pace_ != Pace::kept) return;
    const std::int64_t heard = std::max(last_heard_, last_arrival_.load(std::memory_order_relaxed));
    const bool silent = now - heard > silent_after;
    if (silent && !silent_) announce(Kind::silence);
    silent_ = silent;
  }

  void end_loss(std::int64_t now) {
    if (pace_ == Pace::lost) figures_.integration.real_time_lost += now - lost_since_;
    pace_ = Pace::catching_up;
  }

  void account(std::int64_t begin) {
    const std::int64_t end = monotonic_now();
    figures_.integration.execution.add(end - begin);
    const std::int64_t rollbacks = time_line_.rollbacks().rollbacks;
    if (rollbacks > rollbacks_) figures_.integration.rollback_cost.add(end - begin);
    rollbacks_ = rollbacks;
    for (const std::int64_t due : new_events_due_) {
      figures_.integration.event_latency.add(end - due);
    }
    new_events_due_.clear();
  }

  void on_tick(const typename Stepper::State& state) {
    if (state.tick > last_) return;
    reached_ = state.tick;
    corrected_ = false;
    if (paced() && !at_end()) {
      const std::int64_t due = clock_.local(tick_instant(state.tick, stepper_.h()).hi);
      if (due > first_heard_) {
        const std::int64_t late = monotonic_now() - due;
        figures_.integration.lateness.add(late);
        const double tick = 1e9 * stepper_.h() / clock_.speed();
        if (static_cast<double>(late) > tick) ++figures_.integration.missed;
      }
    }
    if (!send(Kind::estimate, state)) ++figures_.integration.estimates_dropped;
  }

  bool on_settled(const typename Stepper::State& state) {
    if (state.tick > last_) return true;
    return send(Kind::settled, state);
  }

  bool send(Kind kind, const typename Stepper::State& state) {
    Sample* slot = samples_.free_slot();
    if (slot == nullptr) return false;
    slot->kind = kind;
    slot->estimate.session = sessions_.session();
    slot->estimate.tick = state.tick;
    slot->estimate.t = tick_instant(state.tick, stepper_.h()).hi;
    slot->estimate.closed = state.chi;
    slot->estimate.settled_tick =
        std::max<std::int64_t>(kind == Kind::settled ? state.tick : time_line_.handed_out(), -1);
    stepper_.output(state, slot->estimate.q, slot->estimate.u);
    confide(stepper_, state, time_line_.complete_to(slot->estimate.t) ? initial_bound_ : infinity,
            slot->estimate.confidence);
    samples_.push();
    return true;
  }

  // Something to tell people; the publishing thread does.
  void announce(Kind kind) {
    Sample* slot = samples_.free_slot();
    if (slot == nullptr) return;
    slot->kind = kind;
    slot->estimate.session = kind == Kind::other_master ? sessions_.other() : sessions_.session();
    // A time line that starts is about to reach its first tick.
    const std::int64_t tick = kind == Kind::session ? time_line_.now() : reached_;
    slot->estimate.t = tick_instant(std::max<std::int64_t>(tick, 0), stepper_.h()).hi;
    samples_.push();
  }

  // Publishing thread: the one that called run().
  void publish() {
    std::int64_t next_progress = monotonic_now() + progress_period;
    while (!done_ && !stop_ && !stop_requested()) {
      samples_ready_.wait_until(monotonic_now() + 100'000'000);
      emit_all();
      notices_.tell(monotonic_now(), std::cerr);
      if (monotonic_now() >= next_progress) {
        next_progress += progress_period;
        progress();
      }
    }
  }

  void emit_all() {
    while (Sample* sample = samples_.front()) {
      emit(*sample);
      samples_.pop();
    }
  }

  // Nothing follows that would tell a listener that it missed the end.
  void repeat_last() {
    for (int i = 0; i < last_sample_repeats && !last_settled_.empty(); ++i) {
      std::this_thread::sleep_for(10ms);
      (void)bus_.publish(settled_channel, last_settled_);
    }
  }

  void emit(Sample& sample) {
    if (sample.kind != Kind::estimate && sample.kind != Kind::settled) {
      tell(sample);
      return;
    }
    sample.estimate.utime = wall_clock_us();
    const bool settled = sample.kind == Kind::settled;
    if (settled) {
      ++figures_.ticks;
      last_settled_t_ = sample.estimate.t;
      record_.take(sample.estimate.t, sample.estimate.confidence, initial_bound_, std::cerr);
      if (states_) {
        to_columns(sample.estimate.confidence, initial_bound_, columns_);
        states_->write(sample.estimate.tick, sample.estimate.t, sample.estimate.q,
                       sample.estimate.u, columns_);
      }
    }
    std::vector<std::uint8_t>& buffer = settled ? last_settled_ : buffer_;
    if (!bus_.publish(settled ? settled_channel : estimate_channel,
                      encode(sample.estimate, buffer))) {
      ++figures_.unsent;
    }
  }

  void tell(const Sample& sample) {
    const auto digits = std::cerr.precision(12);
    tell_in_full(sample);
    std::cerr.precision(digits);
  }

  void tell_in_full(const Sample& sample) {
    const double t = sample.estimate.t;
    switch (sample.kind) {
      case Kind::session:
        std::cerr << (sample.estimate.session != told_session_ && announced_ > 0
                          ? "new session: the master was restarted; "
                          : "")
                  << "observing from t = " << t << '\n';
        ++announced_;
        told_session_ = sample.estimate.session;
        if (t > duration_) std::cerr << "that is behind --duration: nothing will settle\n";
        return;
      case Kind::other_master:
        std::cerr << "a second master (session " << sample.estimate.session
                  << ") is on the channel; the first is kept\n";
        return;
      case Kind::silence:
        std::cerr << "the master is silent at t = " << t << "; the estimate goes on without it\n";
        return;
      case Kind::end_of_run:
        std::cerr << "the machine's time stands at t = " << t
                  << ": its run is over; the estimate goes on "
                     "without it\n";
        return;
      case Kind::real_time_lost:
        std::cerr << "real time lost at t = " << t << '\n';
        return;
      case Kind::real_time_regained:
        std::cerr << "real time regained at t = " << t << '\n';
        return;
      case Kind::estimate:
      case Kind::settled:
        return;
    }
  }

  void progress() {
    if (states_) states_->flush();
    const bool heard = monotonic_now() - last_arrival_ < progress_period;
    if (announced_ == 0) {
      if (!heard) std::cerr << "waiting for a master\n";
    } else {
      const auto digits = std::cerr.precision(12);
      std::cerr << "settled t " << last_settled_t_ << '\n';
      std::cerr.precision(digits);
    }
  }

  enum class Pace { catching_up, kept, lost };

  int contacts_;
  Eigen::Index coordinates_;
  double initial_bound_;
  bool real_time_;
  Stepper stepper_;
  std::optional<FlowBuilder> flow_builder_;  // of the stepper's flows
  TimeLine<Stepper> time_line_;
  double duration_;
  std::int64_t last_;
  MasterClock clock_;
  SessionTracker sessions_;
  std::int64_t first_heard_ = 0, last_heard_ = 0;
  int stands_still_ = 0;    // messages in a row whose horizon did not rise
  bool corrected_ = false;  // the last tick reached, since it was sent
  std::int64_t corrected_rollbacks_ = 0;
  std::int64_t reached_ = -1;
  std::int64_t rollbacks_ = 0;
  std::vector<std::int64_t> new_events_due_;  // local times
  Pace pace_ = Pace::catching_up;
  std::int64_t lost_since_ = 0;
  bool silent_ = false;
  LiveFigures figures_;  // each thread writes its own part

  SpscQueue<Heard> heard_;
  SpscQueue<Heard> strangers_;
  std::atomic<bool> follows_{false};
  std::atomic<std::int64_t> followed_{0};      // session
  std::atomic<std::int64_t> last_arrival_{0};  // of anything for contacts, monotonic [ns]
  std::atomic<std::int64_t> last_drop_{0};     // of what may have been the master's
  std::int64_t kernel_drops_ = 0;
  std::array<std::int64_t, notice_kinds> kept_away_{};  // by Notice
  Notices notices_;
  SpscQueue<Sample> samples_;
  Wake reports_arrived_;
  Wake samples_ready_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> done_{false};

  Bus bus_;

  std::optional<StatesWriter> states_;
  ConfidenceRecord record_;
  std::vector<double> columns_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> last_settled_;
  int announced_ = 0;
  std::int64_t told_session_ = 0;
  double last_settled_t_ = 0.0;

  ThreadGroup threads_{[this] { stop(); }};  // goes first: the threads use all of the above
};

template <typename Stepper>
int observe(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
            nlohmann::ordered_json& report) {
  LiveObserver<Stepper> observer(scene, options, common);
  observer.run();
  observer.finish(report);
  return exit_done;
}

}  // namespace

int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report) {
  return with_stepper(options.estimator, options.stepper, [&]<typename Stepper>() {
    return observe<Stepper>(scene, options, common, report);
  });
}

}  // namespace sprag
