#include "tools/view/replay.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "lcmtypes/contact_messages.h"
#include "observer/estimation.h"
#include "observer/messages.h"
#include "recording/recorded_events.h"
#include "recording/recording.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/events_file.h"

namespace sprag::view {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t microsecond = 1000;             // ns
constexpr double nanoseconds = 1e9;                    // per second
constexpr double steps_a_second = 60.0;                // of wall time, for an events file
constexpr int steps_without_waiting = 1000;            // for a whole events file, unpaced
constexpr std::int64_t longest_pause = 3'600'000'000;  // of a log [us]; longer: its clock was set
constexpr std::int64_t only_tick_kept = 1;             // a replay has no rollback

// Paces the time of the recording at a given speed.
class Pace {
 public:
  Pace(double speed, Stage& stage) : speed_(speed), stage_(stage), start_(Clock::now()) {}

  /// Waits until this time of the recording [ns from its start]; false if a stop was requested.
  bool wait(double elapsed) {
    while (std::isfinite(speed_) && !stop_requested()) {
      const double now =
          speed_ * std::chrono::duration<double, std::nano>(Clock::now() - start_).count();
      stage_.now = static_cast<std::int64_t>(std::min(now, elapsed));
      if (now >= elapsed) break;
      const std::chrono::duration<double, std::nano> left((elapsed - now) / speed_);
      std::this_thread::sleep_for(std::min<std::chrono::duration<double, std::nano>>(left, 20ms));
    }
    stage_.now = static_cast<std::int64_t>(elapsed);
    return !stop_requested();
  }

 private:
  double speed_;
  Stage& stage_;
  Clock::time_point start_;
};

// Runs an observer, as in `observer --replay`, and passes its settled estimates to the watch.
class OwnObserver {
 public:
  OwnObserver(const Scene& scene, double tick, Stage& stage)
      : estimation_(scene, options_of(tick), only_tick_kept),
        sessions_(Freshness::any, tick),
        sample_(estimation_.empty_sample()),
        outputs_(scene.model.outputs),
        stage_(stage) {}

  void take(const ContactMessage& message, const Arrival& arrival) {
    const SessionTracker::Verdict verdict = sessions_.receive(message, arrival);
    if (verdict == SessionTracker::Verdict::ignored) return;
    if (verdict == SessionTracker::Verdict::starts) {
      estimation_.restart(message);
    } else {
      estimation_.receive(message, verdict == SessionTracker::Verdict::resumes);
    }
    sample_.session = message.session;
    sample_.utime = message.utime;
    settle(arrival);
  }

  /// Samples of a streamed excitation.
  void take(const InputMessage& message, const Arrival& arrival) {
    const bool followed = estimation_.time_line.started() && message.session == sessions_.session();
    if (!estimation_.stream || !followed) return;
    estimation_.stream->take(message);
    settle(arrival);
  }

 private:
  void settle(const Arrival& arrival) {
    estimation_.time_line.run(
        0, [](const auto&) {},
        [&](const Estimation::State& state) {
          check_interrupt();
          estimation_.describe(state, true, sample_);
          sample_.settled_tick = state.tick;
          fill(estimate_, sample_);
          const std::lock_guard lock(stage_.mutex);
          stage_.watch.take_settled(estimate_, arrival);
          if (sample_.confidence.sigma_outputs.size() > 0) {
            fill(outputs_message_, sample_, true, outputs_);
            stage_.watch.take(outputs_message_, arrival);
          }
          if (sample_.confidence.bound_q.size() > 0) {
            fill(bounds_, sample_, outputs_);
            stage_.watch.take(bounds_, arrival);
          }
          return true;
        });
  }

  static ObserverOptions options_of(double tick) {
    ObserverOptions options;
    options.tick = tick;
    return options;
  }

  Estimation estimation_;
  SessionTracker sessions_;
  EstimateSample sample_;
  std::vector<Output> outputs_;
  estimate_t estimate_{};
  outputs_t outputs_message_{};
  bounds_t bounds_{};
  Stage& stage_;
};

bool has_estimates(const std::filesystem::path& file) {
  ChannelLogReader log(file);
  ChannelRecord record;
  while (log.next(record)) {
    if (record.channel == settled_channel || record.channel == estimate_channel) return true;
  }
  return false;
}

class Player {
 public:
  Player(const Scene& scene, const ReplayOptions& options, const CommonOptions& common,
         Stage& stage, Reception& reception, nlohmann::ordered_json& report)
      : contacts_(static_cast<int>(scene.model.contacts.size())),
        clock_(scene.clock),
        options_(options),
        key_(key_of(common)),
        stage_(stage),
        reception_(reception),
        report_(report),
        observer_(scene, options.tick, stage) {}

  bool play() {
    InputFile file(options_.file);
    return is_lcm_log(file) ? log(std::move(file)) : events(std::move(file));
  }

 private:
  bool log(InputFile file) {
    if (!std::filesystem::is_regular_file(options_.file)) {
      throw InputError(options_.file.string() + ": must be a file; its content is examined first");
    }
    const bool estimated = has_estimates(options_.file);
    report_["observed_here"] = !estimated;
    ChannelLogReader log(std::move(file));
    ChannelRecord record;
    Pace pace(options_.speed, stage_);
    std::optional<std::int64_t> before;
    std::int64_t elapsed = 0;  // us
    std::int64_t unauthenticated = 0;
    bool appended = false;  // no contact message since an appended recording began
    ContactMessage message;
    InputMessage input;
    while (log.next(record)) {
      if (before) elapsed += std::clamp<std::int64_t>(record.utime - *before, 0, longest_pause);
      before = record.utime;
      if (!pace.wait(static_cast<double>(elapsed * microsecond))) break;
      std::span<const std::uint8_t> data(record.data);
      if (key_) {
        if (!key_->verifies(record.channel, data)) {
          ++unauthenticated;
          continue;
        }
        data = data.first(data.size() - Key::tag_size);
      }
      appended |= record.appended;
      const bool of_contacts = record.channel == contacts_channel;
      const Arrival arrival{elapsed * microsecond, record.utime,
                            of_contacts && std::exchange(appended, false)};
      reception_.take(record.channel, data, arrival);
      if (!estimated && record.channel == input_channel && decode(data, input) == Refusal::none) {
        observer_.take(input, arrival);
      }
      const bool observed = !estimated && of_contacts && decode(data, message) == Refusal::none &&
                            message.contacts == contacts_;
      if (!observed) continue;
      to_machine_time(clock_, message);
      observer_.take(message, arrival);
    }
    if (key_) report_["unauthenticated"] = unauthenticated;
    for (const LogDamage& damage : log.damages()) {
      std::cerr << options_.file.string() << ": from byte " << damage.begin << ": " << damage.what
                << "; the rest is used\n";
      report_["damage"].push_back(
          {{"from", damage.begin}, {"to", damage.end}, {"what", damage.what}});
    }
    return log.damages().empty();
  }

  bool events(InputFile file) {
    const std::string name = options_.file.string();
    std::vector<std::string> problems;
    EventsFile recorded = read_machine_events(
        std::move(file), contacts_, std::numeric_limits<double>::infinity(), clock_, problems, "");
    for (const std::string& problem : problems) std::cerr << problem << '\n';
    report_["observed_here"] = true;
    report_["skipped_rows"] = recorded.skipped.size();
    for (const FileProblem& problem : recorded.skipped) {
      std::cerr << name << ':' << problem.line << ": skipped: " << problem.what << '\n';
    }
    if (recorded.damage) {
      std::cerr << name << ':' << recorded.damage->line << ": " << recorded.damage->what
                << "; everything before is used\n";
      report_["damage"] = {{"line", recorded.damage->line}, {"what", recorded.damage->what}};
    }
    const double end = recorded.events.empty() ? 0.0 : recorded.events.back().t;
    const bool waits = std::isfinite(options_.speed);
    const double step = waits ? options_.speed / steps_a_second : end / steps_without_waiting;
    MessageBuilder builder(1, 1.0, contacts_);
    Pace pace(options_.speed, stage_);
    auto event = recorded.events.begin();
    for (std::int64_t k = 1; event != recorded.events.end(); ++k) {
      const double horizon = std::min(static_cast<double>(k) * step, end);
      if (!pace.wait(nanoseconds * horizon)) break;
      const auto first = event;
      while (event != recorded.events.end() && event->t <= horizon) ++event;
      builder.add({first, event});
      do {
        take(builder.next(horizon, 0), horizon);
      } while (builder.pending());
    }
    return !recorded.damage;
  }

  void take(const ContactMessage& message, double t) {
    const Arrival arrival{static_cast<std::int64_t>(nanoseconds * t), 0};
    {
      const std::lock_guard lock(stage_.mutex);
      stage_.watch.take(message, arrival);
    }
    observer_.take(message, arrival);
  }

  int contacts_;
  ContactClock clock_;
  const ReplayOptions& options_;
  std::optional<Key> key_;
  Stage& stage_;
  Reception& reception_;
  nlohmann::ordered_json& report_;
  OwnObserver observer_;
};

}  // namespace

bool replay(const Scene& scene, const ReplayOptions& options, const CommonOptions& common,
            Stage& stage, Reception& reception, nlohmann::ordered_json& report) {
  bool whole = true;
  try {
    whole = Player(scene, options, common, stage, reception, report).play();
  } catch (const Interrupted&) {
  }
  return whole;
}

}  // namespace sprag::view
