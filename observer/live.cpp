#include "observer/live.h"

#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <iostream>
#include <optional>
#include <thread>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "lcmtypes/program.h"
#include "lcmtypes/state_codec.h"
#include "mechanics/moreau.h"
#include "mechanics/replica.h"
#include "mechanics/states_file.h"
#include "observer/master_clock.h"
#include "observer/report.h"
#include "observer/session_tracker.h"
#include "observer/spsc_queue.h"
#include "observer/time_line.h"
#include "observer/wake.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t report_slots = 1024;
constexpr std::size_t sample_slots = 16384;
constexpr std::int64_t max_history_bytes = 256 << 20;
constexpr int last_sample_repeats = 5;
constexpr double history_time = 2.0;                     // simulated s that can be redone
constexpr std::int64_t longest_wait = 2'000'000;         // ns
constexpr std::int64_t progress_period = 1'000'000'000;  // ns

struct Heard {
  ContactReport report;
  std::int64_t arrival = 0;
};

struct Sample {
  enum class Kind { estimate, settled, session } kind = Kind::estimate;
  EstimateSample estimate;
};

struct Lateness {
  std::int64_t ticks = 0;   // with a deadline
  std::int64_t missed = 0;  // later than the next tick was due
  double worst = 0.0;       // s
};

std::int64_t history_ticks(const Scene& scene, double h) {
  const auto wanted = static_cast<std::int64_t>(std::ceil(history_time / h));
  const std::int64_t bytes = 1024 + 64 * scene.model.coordinates();
  return std::clamp<std::int64_t>(wanted, 16,
                                  std::max<std::int64_t>(16, max_history_bytes / bytes));
}

template <typename Stepper>
class LiveObserver {
 public:
  LiveObserver(const Scene& scene, const ObserverOptions& options, const std::string& url)
      : contacts_(static_cast<int>(scene.model.contacts.size())),
        coordinates_(scene.model.coordinates()),
        stepper_(scene.model, options.tick),
        time_line_(stepper_, contacts_, scene.replica, history_ticks(scene, options.tick)),
        last_(std::isinf(options.duration) ? std::numeric_limits<std::int64_t>::max()
                                           : last_tick(options.duration, options.tick)),
        heard_(report_slots, Heard{}),
        samples_(sample_slots, empty_sample()),
        bus_(url) {
    if (!options.states.empty()) {
      states_.emplace(options.states, coordinates_);
      if (!states_->good()) throw std::runtime_error(states_->error());
    }
    bus_.subscribe(contacts_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                            std::int64_t) { hear(data); });
    std::cerr << "listening on " << url << '\n';
  }

  int run() {
    std::thread receiving([this] { receive(); });
    std::thread integrating([this] { integrate(); });
    publish();
    stop_ = true;
    reports_arrived_.signal();
    integrating.join();
    receiving.join();
    emit_all();
    repeat_last();
    if (error_) std::rethrow_exception(error_);
    return exit_done;
  }

  void finish(nlohmann::ordered_json& report) {
    const MessageCounts& counts = sessions_.counts();
    report["ticks"] = settled_;
    report["settled_tick"] = time_line_.handed_out();
    report["missed_deadlines"] = lateness_.missed;
    report["ticks_with_deadline"] = lateness_.ticks;
    report["worst_lateness_s"] = lateness_.worst;
    report["estimates_dropped"] = dropped_;
    report["flow_path"] = flow_path(stepper_);
    report["refused_impacts"] = refused_impacts_;
    nlohmann::ordered_json refused = nlohmann::ordered_json::object();
    for (int i = 1; i < refusal_kinds; ++i) {
      const std::int64_t count = refused_[static_cast<std::size_t>(i)];
      if (count > 0) refused[std::string(name(static_cast<Refusal>(i)))] = count;
    }
    if (other_machine_ > 0) refused["other_machine"] = other_machine_;
    report["messages"] = {
        {"received", counts.received},   {"refused", refused},
        {"lost", counts.lost},           {"doubled", counts.doubled},
        {"reordered", counts.reordered}, {"of_past_sessions", counts.of_past_sessions},
        {"overflowed", overflowed_},     {"unsent", unsent_}};
    report["sessions"] = counts.sessions;
    report.update(to_json(time_line_.events()));
    report["rollbacks"] = to_json(time_line_.rollbacks());
    for (const DegradedInterval& gap : time_line_.events().degraded()) {
      std::cerr << "events may be missing between t = " << gap.from << " and " << gap.to << '\n';
    }
    if (states_ && !states_->close()) throw std::runtime_error(states_->error());
  }

 private:
  Sample empty_sample() const {
    Sample sample;
    sample.estimate.q.setZero(coordinates_);
    sample.estimate.u.setZero(coordinates_);
    return sample;
  }

  // Receiving thread.
  void receive() {
    try {
      while (!stop_) bus_.handle(50ms);
    } catch (...) {
      error_ = std::current_exception();
      done_ = true;
      samples_ready_.signal();
    }
  }

  void hear(std::span<const std::uint8_t> data) {
    Heard* slot = heard_.free_slot();
    if (slot == nullptr) {
      ++overflowed_;
      return;
    }
    slot->arrival = monotonic_now();
    const Refusal refusal = decode(data, slot->report);
    if (refusal != Refusal::none) {
      ++refused_[static_cast<std::size_t>(refusal)];
    } else if (slot->report.contacts != contacts_) {
      ++other_machine_;
    } else {
      heard_.push();
      reports_arrived_.signal();
    }
  }

  // Integrating thread: the real-time loop.
  void integrate() {
    while (!stop_ && !done_) {
      reports_arrived_.wait_until(next_deadline());
      while (Heard* heard = heard_.front()) {
        take(*heard);
        heard_.pop();
      }
      if (!time_line_.started()) continue;
      const std::int64_t now = monotonic_now();
      const double simulated = clock_.simulated(now);
      const std::int64_t target = simulated > 0.0 ? last_tick(simulated, stepper_.h()) : 0;
      time_line_.run(
          std::min(target, last_), [this](const auto& state) { on_tick(state); },
          [this](const auto& state) { return on_settled(state); });
      if (time_line_.handed_out() >= last_) done_ = true;
      samples_ready_.signal();
    }
    samples_ready_.signal();
  }

  std::int64_t next_deadline() const {
    const std::int64_t now = monotonic_now();
    if (!time_line_.started() || std::isinf(clock_.speed())) return now + longest_wait;
    const double next = tick_instant(time_line_.now() + 1, stepper_.h()).hi;
    return std::clamp(clock_.local(next), now, now + longest_wait);
  }

  void take(const Heard& heard) {
    switch (sessions_.hear(heard.report)) {
      case SessionTracker::Verdict::ignored:
        return;
      case SessionTracker::Verdict::starts:
        clock_.restart();
        clock_.observe(heard.report, heard.arrival);
        first_heard_ = heard.arrival;
        time_line_.restart(heard.report);
        announce_session();
        return;
      case SessionTracker::Verdict::continues:
        clock_.observe(heard.report, heard.arrival);
        time_line_.receive(heard.report);
        return;
    }
  }

  void on_tick(const typename Stepper::State& state) {
    if (state.tick > last_) return;
    if (std::isfinite(clock_.speed())) {
      const double t = tick_instant(state.tick, stepper_.h()).hi;
      const std::int64_t due = clock_.local(t);
      if (due > first_heard_) {
        const double late = 1e-9 * static_cast<double>(monotonic_now() - due);
        ++lateness_.ticks;
        if (late > stepper_.h() / clock_.speed()) ++lateness_.missed;
        lateness_.worst = std::max(lateness_.worst, late);
      }
    }
    if (!send(Sample::Kind::estimate, state)) ++dropped_;
  }

  bool on_settled(const typename Stepper::State& state) {
    if (state.tick > last_) return true;
    refused_impacts_ = state.refused_impacts;
    return send(Sample::Kind::settled, state);
  }

  bool send(Sample::Kind kind, const typename Stepper::State& state) {
    Sample* slot = samples_.free_slot();
    if (slot == nullptr) return false;
    slot->kind = kind;
    slot->estimate.session = sessions_.session();
    slot->estimate.tick = state.tick;
    slot->estimate.t = tick_instant(state.tick, stepper_.h()).hi;
    slot->estimate.closed = state.chi;
    slot->estimate.settled_tick = std::max<std::int64_t>(
        kind == Sample::Kind::settled ? state.tick : time_line_.handed_out(), -1);
    stepper_.output(state, slot->estimate.q, slot->estimate.u);
    samples_.push();
    return true;
  }

  void announce_session() {
    Sample* slot = samples_.free_slot();
    if (slot == nullptr) return;
    slot->kind = Sample::Kind::session;
    slot->estimate.session = sessions_.session();
    slot->estimate.t = tick_instant(time_line_.now(), stepper_.h()).hi;
    samples_.push();
  }

  // Publishing thread: the one that called run().
  void publish() {
    std::int64_t next_progress = monotonic_now() + progress_period;
    while (!done_ && !stop_requested()) {
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
    if (sample.kind == Sample::Kind::session) {
      ++announced_;
      std::cerr << (announced_ > 1 ? "new session: the master was restarted; " : "")
                << "observing from t = " << sample.estimate.t << '\n';
      return;
    }
    sample.estimate.utime = wall_clock_us();
    const bool settled = sample.kind == Sample::Kind::settled;
    if (settled) {
      ++settled_;
      last_settled_t_ = sample.estimate.t;
      if (states_) {
        states_->write(sample.estimate.tick, sample.estimate.t, sample.estimate.q,
                       sample.estimate.u);
      }
    }
    std::vector<std::uint8_t>& buffer = settled ? last_settled_ : buffer_;
    if (!bus_.publish(settled ? settled_channel : estimate_channel,
                      encode(sample.estimate, buffer))) {
      ++unsent_;
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

  int contacts_;
  Eigen::Index coordinates_;
  Stepper stepper_;
  TimeLine<Stepper> time_line_;
  std::int64_t last_;
  MasterClock clock_;
  SessionTracker sessions_;
  std::int64_t first_heard_ = 0;
  Lateness lateness_;
  std::int64_t dropped_ = 0;
  std::int64_t refused_impacts_ = 0;

  SpscQueue<Heard> heard_;
  SpscQueue<Sample> samples_;
  Wake reports_arrived_;
  Wake samples_ready_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> done_{false};

  Bus bus_;
  std::exception_ptr error_;  // of the receiving thread; read after it has ended
  std::array<std::int64_t, refusal_kinds> refused_{};
  std::int64_t other_machine_ = 0;
  std::int64_t overflowed_ = 0;

  std::optional<StatesWriter> states_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> last_settled_;
  std::int64_t settled_ = 0;
  std::int64_t unsent_ = 0;
  int announced_ = 0;
  double last_settled_t_ = 0.0;
};

template <typename Stepper>
int observe(const Scene& scene, const ObserverOptions& options, const std::string& url,
            nlohmann::ordered_json& report) {
  LiveObserver<Stepper> observer(scene, options, url);
  const int code = observer.run();
  observer.finish(report);
  return code;
}

}  // namespace

int run_live(const Scene& scene, const ObserverOptions& options, const std::string& url,
             nlohmann::ordered_json& report) {
  return options.stepper == StepperKind::exact
             ? observe<Replica>(scene, options, url, report)
             : observe<MoreauReplica>(scene, options, url, report);
}

}  // namespace sprag
