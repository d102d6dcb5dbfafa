#include "master_sim/master_process.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "command_line/program.h"
#include "command_line/scene_inputs.h"
#include "lcmtypes/bus.h"
#include "lcmtypes/contact_sender.h"
#include "lcmtypes/messages.h"
#include "lcmtypes/wall_clock.h"
#include "master_sim/record_sender.h"
#include "sprag/detail/files/confidence_columns.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/text/printable.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;
using Clock = ContactSender::Clock;

constexpr auto longest_sleep = 1ms;
constexpr auto progress_period = 1s;
// Initial simulated time that an unpaced master covers between two checks of the clock. It doubles
// while no events occur.
constexpr double least_stride = 1.0;

// Events that the simulation finds before they are written and sent.
constexpr std::size_t events_at_once = 1000;

// The record of the scene's excitation. Throws UsageError if it cannot be published.
SampledInputPointer record_of(const Scene& scene) {
  for (const Force& force : scene.model.forces) {
    if (!force.input) continue;
    if (!has_even_samples(*force.input) || force.input->settings().displacement) break;
    return force.input;
  }
  throw UsageError(
      "--publish-input: " + printable(scene.name) +
      " must have a recorded acceleration or force with even samples (the key `file`)");
}

class MasterProcess {
 public:
  MasterProcess(const Scene& scene, const MasterOptions& options, const CommonOptions& common)
      : options_(options),
        clock_(scene.clock),
        master_(scene.model, scene.truth.start),
        last_tick_(std::isinf(options.duration) ? std::numeric_limits<std::int64_t>::max()
                                                : last_tick(options.duration, options.tick)),
        wants_states_(!options.states.empty() || (options.lcm && options.truth)) {
    if (options.lcm) {
      bus_.emplace(common.url, key_of(common));
      sender_.emplace(*bus_, static_cast<int>(scene.model.contacts.size()),
                      scene.clock.rate * options.speed);
      state_.session = sender_->session();
      if (options.publish_input) {
        record_sender_.emplace(*bus_, record_of(scene), sender_->session());
      }
    }
    if (!options.events.empty()) {
      events_file_.emplace(options.events);
      events_file_->require_good();
    }
    if (!options.states.empty()) {
      states_file_.emplace(options.states, scene.model.coordinates(),
                           output_columns(scene.model.outputs, false));
      states_file_->require_good();
      outputs_ = scene.model.outputs;
      output_values_.resize(outputs_.size());
    }
    state_.f = static_cast<std::int32_t>(scene.model.coordinates());
    state_.q.resize(static_cast<std::size_t>(state_.f));
    state_.u.resize(static_cast<std::size_t>(state_.f));
  }

  /// Runs to the end or to a signal, which may interrupt a computation, then sends the final
  /// messages. They are also sent if the simulation cannot continue (SimulationError, ModelError).
  void run() {
    try {
      loop();
    } catch (const Interrupted&) {
    } catch (const Error&) {
      say_goodbye();
      throw;
    }
    say_goodbye();
  }

  void finish(nlohmann::ordered_json& report) {
    report["t"] = reached_;
    report["events"] = events_;
    report["impacts"] = master_.impacts();
    report["flow_path"] = name(master_.flows()[0].path());
    report["expansions"] = master_.expansions();
    report["ticks"] = next_tick_;
    report["session"] = state_.session;
    report["messages"] = sender_ ? sender_->messages() : 0;
    report["unsent"] = (sender_ ? sender_->unsent() : 0) + unsent_states_ +
                       (record_sender_ ? record_sender_->unsent() : 0);
    if (record_sender_) report["input_messages"] = record_sender_->messages();
    report["wall_s"] = std::chrono::duration<double>(Clock::now() - start_).count();
    const bool events_good = !events_file_ || events_file_->close();
    const bool states_good = !states_file_ || states_file_->close();
    if (!events_good) throw std::runtime_error(events_file_->error());
    if (!states_good) throw std::runtime_error(states_file_->error());
    if (bus_) bus_->finish();
  }

 private:
  /// The main loop.
  void loop() {
    start_ = Clock::now();
    auto next_progress = start_ + progress_period;
    while (!stop_requested()) {
      const double t = std::min(due(), options_.duration);
      advance(t);
      if (sender_ && sender_->due()) {
        send();
        if (record_sender_) record_sender_->send(reached_);
      }
      if (t >= options_.duration) break;
      if (Clock::now() >= next_progress) {
        progress(t);
        next_progress += progress_period;
      }
      if (!std::isinf(options_.speed)) std::this_thread::sleep_until(next_wake());
    }
  }

  double due() const {
    if (std::isinf(options_.speed)) {
      return reached_ + (record_sender_ ? std::min(stride_, record_sender_->stride()) : stride_);
    }
    return options_.speed * std::chrono::duration<double>(Clock::now() - start_).count();
  }

  Clock::time_point wall(double t) const {
    return start_ + std::chrono::duration_cast<Clock::duration>(
                        std::chrono::duration<double>(t / options_.speed));
  }

  Clock::time_point next_wake() const {
    auto soonest = Clock::now() + longest_sleep;
    if (sender_) soonest = std::min(soonest, sender_->next());
    const double event = master_.next_event();
    if (!std::isinf(event)) soonest = std::min(soonest, wall(event));
    if (!wants_states_ || next_tick_ > last_tick_) return soonest;
    return std::min(soonest, wall(tick_instant(next_tick_, options_.tick).hi));
  }

  void advance(double t) {
    const std::int64_t ticks =
        wants_states_ ? std::min(last_tick(t, options_.tick), last_tick_) : -1;
    while (next_tick_ <= ticks) {
      const Instant instant = tick_instant(next_tick_, options_.tick);
      find_events(instant);
      write_state(instant);
      ++next_tick_;
    }
    const std::int64_t before = events_;
    find_events(at(t));
    reached_ = t;
    if (wants_states_) return;
    stride_ = events_ > before ? std::max(0.5 * stride_, least_stride) : 2.0 * stride_;
  }

  void find_events(Instant t) {
    bool arrived = false;
    while (!arrived) {
      check_interrupt();
      found_.clear();
      try {
        arrived = master_.advance(t, found_, events_at_once);
      } catch (...) {
        take_events();
        throw;
      }
      take_events();
    }
  }

  void take_events() {
    events_ += static_cast<std::int64_t>(found_.size());
    if (!found_.empty()) reached_ = found_.back().t;
    for (ContactEvent& event : found_) event.t = clock_time(clock_, event.t);
    if (sender_) sender_->add(found_);
    if (events_file_) {
      for (const ContactEvent& event : found_) events_file_->write(event);
    }
  }

  // The watermark is on the contact clock, as the events are. Readers must not find it before
  // `reached_` by rounding, because the last tick would not settle.
  void send() {
    double horizon = clock_time(clock_, reached_);
    while (machine_time(clock_, horizon) < reached_) {
      horizon = std::nextafter(horizon, std::numeric_limits<double>::infinity());
    }
    sender_->send(horizon);
  }

  void write_state(Instant t) {
    Eigen::Map<Eigen::VectorXd> q(state_.q.data(), state_.f), u(state_.u.data(), state_.f);
    master_.state(t, q, u);
    if (states_file_) {
      for (std::size_t i = 0; i < outputs_.size(); ++i) {
        output_values_[i] = value(outputs_[i], q, u);
      }
      states_file_->write(next_tick_, t.hi, q, u, output_values_);
    }
    if (!bus_ || !options_.truth) return;
    state_.utime = wall_clock_us();
    state_.tick = next_tick_;
    state_.t = t.hi;
    state_.closed = static_cast<std::int64_t>(master_.closed());
    if (!bus_->publish(truth_channel, encode(state_, buffer_))) ++unsent_states_;
  }

  void say_goodbye() {
    if (!sender_) return;
    for (int i = 0; i < ContactSender::goodbyes; ++i) {
      if (i > 0) std::this_thread::sleep_for(ContactSender::heartbeat);
      send();
      // The sample after the end completes the last interval.
      if (record_sender_) record_sender_->send(reached_, 1);
      if (options_.truth && next_tick_ > 0)
        (void)bus_->publish(truth_channel, encode(state_, buffer_));
    }
  }

  void progress(double t) {
    if (events_file_ && !events_file_->flush()) report_failure(*events_file_, reported_events_);
    if (states_file_ && !states_file_->flush()) report_failure(*states_file_, reported_states_);
    std::cerr << "t " << t << "  events " << events_ << '\n';
  }

  // The run continues, since observers may follow it.
  static void report_failure(const CsvWriter& file, bool& reported) {
    if (reported) return;
    std::cerr << file.error() << ": nothing more is written to it; the run goes on\n";
    reported = true;
  }

  MasterOptions options_;
  ContactClock clock_;
  Master master_;
  std::int64_t last_tick_;
  bool wants_states_;
  std::optional<Bus> bus_;
  std::optional<ContactSender> sender_;        // on the bus
  std::optional<RecordSender> record_sender_;  // with options_.publish_input
  std::optional<EventsWriter> events_file_;
  std::optional<StatesWriter> states_file_;
  bool reported_events_ = false, reported_states_ = false;
  std::vector<Output> outputs_;
  std::vector<double> output_values_;

  Clock::time_point start_;
  double reached_ = 0.0;
  double stride_ = least_stride;
  std::int64_t next_tick_ = 0;
  std::int64_t events_ = 0;
  std::int64_t unsent_states_ = 0;
  std::vector<ContactEvent> found_;
  state_t state_{};
  std::vector<std::uint8_t> buffer_;
};

// Scenes without [master] are valid, so the start is checked here and not by the reader.
void require_start_outside(const Scene& scene) {
  if (scene.truth.given) return;
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    const double g = gap(scene.model.contacts[i], scene.truth.start.q, 0.0);
    if (g >= 0.0) continue;
    throw UsageError(printable(scene.name) +
                     " does not say where the machine starts, and q = 0 lies inside " +
                     "the support of contact " + std::to_string(i + 1) + "; give [master] q");
  }
}

}  // namespace

int run_master(const Scene& scene, const MasterOptions& options, const CommonOptions& common,
               nlohmann::ordered_json& report) {
  if (std::isinf(options.speed) && std::isinf(options.duration)) {
    throw UsageError("--speed max needs --duration: an unpaced run has no natural end");
  }
  require_inputs_until(scene, options.duration, "--duration");
  require_start_outside(scene);
  if (scene.clock.offset < 0.0) {
    throw UsageError(
        "clock.offset is negative: events before the contact clock's 0 have no time in "
        "messages and files; must be >= 0 for master_sim");
  }
  if (options.publish_input) {
    if (!options.lcm) throw UsageError("--publish-input and --no-lcm exclude each other");
    (void)record_of(scene);
  }
  MasterProcess process(scene, options, common);
  try {
    process.run();
  } catch (const Error&) {
    process.finish(report);
    throw;
  }
  process.finish(report);
  return exit_done;
}

}  // namespace sprag
