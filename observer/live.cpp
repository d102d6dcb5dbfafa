#include "observer/live.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <thread>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "lcmtypes/program.h"
#include "lcmtypes/state_codec.h"
#include "mechanics/states_file.h"
#include "observer/confidence_record.h"
#include "observer/figures.h"
#include "observer/master_clock.h"
#include "observer/real_time.h"
#include "observer/report.h"
#include "observer/session_tracker.h"
#include "observer/spsc_queue.h"
#include "observer/thread_group.h"
#include "observer/time_line.h"
#include "observer/wake.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t report_slots = 1024;
constexpr std::size_t sample_slots = 16384;
constexpr std::int64_t max_history_bytes = 256 << 20;
constexpr int last_sample_repeats = 5;
constexpr std::int64_t longest_wait = 2'000'000;         // ns
constexpr std::int64_t progress_period = 1'000'000'000;  // ns
// The loop looks at the clock and at the messages at least as often as this.
constexpr std::int64_t ticks_per_turn = 4096;
constexpr std::int64_t real_time_lost_after = 100'000'000;  // ns
constexpr std::int64_t silent_after = 1'000'000'000;        // ns
constexpr std::size_t most_new_events = 4096;               // per turn, whose latency is taken
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

using Kind = Sample::Kind;

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
        last_(std::isinf(options.duration) ? std::numeric_limits<std::int64_t>::max()
                                           : last_tick(options.duration, options.tick)),
        sessions_(common.key.empty() ? Freshness::any : Freshness::required),
        heard_(report_slots, Heard{}),
        samples_(sample_slots, empty_sample()),
        bus_(common.url, key_of(common)) {
    new_events_due_.reserve(most_new_events);
    if (!options.states.empty()) {
      states_.emplace(options.states, coordinates_,
                      confidence_columns(empty_sample().estimate.confidence, initial_bound_));
      if (!states_->good()) throw std::runtime_error(states_->error());
    }
    bus_.subscribe(contacts_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                            std::int64_t) { hear(data); });
    if (real_time_) claim_real_time();
    std::cerr << "listening on " << common.url << '\n';
  }

  /// Until the run is over, or a thread has failed; then finish() says so.
  void run() {
    threads_.run([this] {
      threads_.start([this] { receive(); });
      threads_.start([this] { integrate(); });
      publish();
    });
    threads_.end();
    threads_.run([this] {
      emit_all();
      repeat_last();
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
    report["refused_impacts"] = refused_impacts_;
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
    while (!stop_) bus_.handle(50ms);
  }

  void hear(std::span<const std::uint8_t> data) {
    Heard* slot = heard_.free_slot();
    if (slot == nullptr) {
      ++figures_.reception.overflowed;
      return;
    }
    slot->arrival = {monotonic_now(), wall_clock_us()};
    const Refusal refusal = decode(data, slot->report);
    if (refusal != Refusal::none) {
      ++figures_.reception.refused[static_cast<std::size_t>(refusal)];
    } else if (slot->report.contacts != contacts_) {
      ++figures_.reception.other_machine;
    } else {
      heard_.push();
      reports_arrived_.signal();
    }
  }

  // Integrating thread: the real-time loop.
  void integrate() {
    prepare_thread(integrating_priority);
    bool in_time = true;
    while (!stop_ && !done_) {
      if (in_time) wait();
      const std::int64_t begin = monotonic_now();
      take_reports();
      if (!time_line_.started()) continue;
      watch(begin);
      in_time = advance(begin);
      watch(monotonic_now());
      account(begin);
      samples_ready_.signal();
    }
    figures_.integration.unsettled_ticks = std::min(reached_, last_) - time_line_.handed_out();
    end_loss(monotonic_now());
    samples_ready_.signal();
  }

  // Until the next tick is due; without a pace, until something is heard.
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
    sleep_until(idle ? latest : std::min(clock_.local(next), latest));
  }

  void take_reports() {
    while (Heard* heard = heard_.front()) {
      take(*heard);
      heard_.pop();
    }
  }

  void take(const Heard& heard) {
    const ContactReport& report = heard.report;
    if (report.session == sessions_.session() && !clock_.plausible(report, heard.arrival)) {
      ++figures_.integration.implausible;
      return;
    }
    const std::int64_t lost = sessions_.counts().lost;
    const std::int64_t others = sessions_.counts().of_other_masters;
    switch (sessions_.hear(report, heard.arrival)) {
      case SessionTracker::Verdict::ignored:
        if (others == 0 && sessions_.counts().of_other_masters > 0) announce(Kind::other_master);
        return;
      case SessionTracker::Verdict::starts:
        clock_.restart();
        clock_.observe(report, heard.arrival);
        first_heard_ = last_heard_ = heard.arrival.monotonic;
        end_loss(first_heard_);
        pace_ = Pace::catching_up;
        time_line_.restart(report);
        reached_ = time_line_.now() - 1;
        announce(Kind::session);
        return;
      case SessionTracker::Verdict::continues:
        clock_.observe(report, heard.arrival);
        last_heard_ = heard.arrival.monotonic;
        receive_events(report, sessions_.counts().lost > lost);
        return;
    }
  }

  void receive_events(const ContactReport& report, bool behind_a_loss) {
    const std::size_t known = time_line_.events().events().size();
    time_line_.receive(report);
    const auto& events = time_line_.events().events();
    if (behind_a_loss) {
      figures_.integration.repaired_events += static_cast<std::int64_t>(events.size() - known);
    }
    if (std::isinf(clock_.speed())) return;
    for (std::size_t i = known; i < events.size() && new_events_due_.size() < most_new_events;
         ++i) {
      new_events_due_.push_back(clock_.local(events[i].t));
    }
  }

  // Runs to the tick that is due; false if there was more to do than a turn may take.
  bool advance(std::int64_t now) {
    const double simulated = clock_.simulated(now);
    const std::int64_t due = simulated > 0.0 ? last_tick(simulated, stepper_.h()) : 0;
    const bool in_time = time_line_.run(
        std::min(due, last_), [this](const auto& state) { on_tick(state); },
        [this](const auto& state) { return on_settled(state); }, ticks_per_turn);
    if (time_line_.handed_out() >= last_) done_ = true;
    return in_time;
  }

  // Whether the estimate keeps up with the master, and whether the master is still there.
  void watch(std::int64_t now) {
    if (std::isinf(clock_.speed())) return;
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
    const bool silent = now - last_heard_ > silent_after;
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
    if (std::isfinite(clock_.speed())) {
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
    refused_impacts_ = state.refused_impacts;
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
    slot->estimate.t = tick_instant(std::max<std::int64_t>(reached_, 0), stepper_.h()).hi;
    samples_.push();
  }

  // Publishing thread: the one that called run().
  void publish() {
    std::int64_t next_progress = monotonic_now() + progress_period;
    while (!done_ && !stop_ && !stop_requested()) {
      samples_ready_.wait_until(monotonic_now() + 100'000'000);
      emit_all();
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
    const double t = sample.estimate.t;
    switch (sample.kind) {
      case Kind::session:
        ++announced_;
        std::cerr << (announced_ > 1 ? "new session: the master was restarted; " : "")
                  << "observing from t = " << t << '\n';
        return;
      case Kind::other_master:
        std::cerr << "a second master (session " << sample.estimate.session
                  << ") is on the channel; the first is kept\n";
        return;
      case Kind::silence:
        std::cerr << "the master is silent at t = " << t << "; the estimate goes on without it\n";
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
    if (announced_ == 0) {
      std::cerr << "waiting for a master\n";
    } else {
      std::cerr << "settled t " << last_settled_t_ << '\n';
    }
  }

  enum class Pace { catching_up, kept, lost };

  int contacts_;
  Eigen::Index coordinates_;
  double initial_bound_;
  bool real_time_;
  Stepper stepper_;
  TimeLine<Stepper> time_line_;
  std::int64_t last_;
  MasterClock clock_;
  SessionTracker sessions_;
  std::int64_t first_heard_ = 0, last_heard_ = 0;
  std::int64_t reached_ = -1;
  std::int64_t rollbacks_ = 0;
  std::vector<std::int64_t> new_events_due_;  // local times
  Pace pace_ = Pace::catching_up;
  std::int64_t lost_since_ = 0;
  bool silent_ = false;
  std::int64_t refused_impacts_ = 0;
  LiveFigures figures_;  // each thread writes its own part

  SpscQueue<Heard> heard_;
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
