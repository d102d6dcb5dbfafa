#include "observer/replay.h"

#include <algorithm>
#include <iostream>
#include <limits>
#include <optional>

#include "command_line/program.h"
#include "lcmtypes/bus.h"
#include "observer/confidence_record.h"
#include "observer/notices.h"
#include "observer/recording.h"
#include "observer/report.h"
#include "observer/session_tracker.h"
#include "observer/wake.h"
#include "sprag/estimation/time_line.h"
#include "sprag/files/events_file.h"
#include "sprag/files/states_file.h"

namespace sprag {
namespace {

// A replay knows the future: it never goes back further than the tick it is at.
constexpr std::int64_t replay_history = 1;

constexpr double infinity = std::numeric_limits<double>::infinity();

template <typename Stepper>
class Replay {
 public:
  Replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay)
      : contacts_(static_cast<int>(scene.model.contacts.size())),
        stepper_(make_stepper<Stepper>(scene, options.tick)),
        time_line_(stepper_, contacts_, scene.replica, replay_history),
        h_(options.tick),
        last_(std::isinf(options.duration) ? std::numeric_limits<std::int64_t>::max()
                                           : last_tick(options.duration, options.tick)),
        duration_(options.duration),
        q_(scene.model.coordinates()),
        u_(scene.model.coordinates()),
        initial_bound_(initial_bound(scene)),
        confidence_(empty_confidence<Stepper>(scene.model.coordinates(), contacts_)) {
    if (!options.states.empty()) {
      states_.emplace(options.states, scene.model.coordinates(),
                      confidence_columns(confidence_, initial_bound_));
    }
    if (!replay.events.empty()) events_.emplace(replay.events);
    if (states_ && !states_->good()) throw std::runtime_error(states_->error());
    if (events_ && !events_->good()) throw std::runtime_error(events_->error());
  }

  bool events_csv(InputFile file, nlohmann::ordered_json& report) {
    const std::string name = file.path().string();
    const EventsFile recorded = read_events(std::move(file), contacts_);
    for (const FileProblem& problem : recorded.skipped) {
      std::cerr << name << ':' << problem.line << ": skipped: " << problem.what << '\n';
    }
    if (recorded.damage) {
      std::cerr << name << ':' << recorded.damage->line << ": " << recorded.damage->what
                << "; everything before is used\n";
      report["damage"] = {{"line", recorded.damage->line}, {"what", recorded.damage->what}};
    }
    report["skipped_rows"] = recorded.skipped.size();
    time_line_.restart(0, 0, 0, no_horizon);
    double end = 0.0;
    for (const ContactEvent& event : recorded.events) {
      if (event.t > duration_) break;
      const EventCounts before = time_line_.events().counts();
      time_line_.receive(event);
      raise_skipped(time_line_.events(), before, notices_);
      end = event.t;
    }
    const double until = std::isinf(duration_) ? end : duration_;
    if (recorded.missing_from <= until) {
      time_line_.degrade(recorded.missing_from, std::min(recorded.missing_to, until));
    }
    time_line_.set_horizon(until);
    if (until > end) {
      std::cerr << name << ": no event behind t = " << end
                << ": from there on the estimate runs free\n";
      report["runs_free_from"] = end;
    }
    if (!recorded.events.empty() || !std::isinf(duration_)) settle();
    return !recorded.damage;
  }

  bool lcm_log(InputFile file, const std::optional<Key>& key, nlohmann::ordered_json& report) {
    const std::string name = file.path().string();
    RecordedReports log(std::move(file), contacts_, key);
    // Recordings are as old as they are.
    SessionTracker sessions(Freshness::any, h_);
    ContactReport contacts;
    Arrival arrival;
    try {
      while (!done() && log.next(contacts, arrival)) {
        check_interrupt();
        take(contacts, arrival, sessions);
        notices_.tell(monotonic_now(), std::cerr);
        settle();
      }
    } catch (const Interrupted&) {  // what was settled until then counts
    }
    const MessageCounts& counts = sessions.counts();
    report["messages"] = {{"received", counts.received},
                          {"refused", log.refused()},
                          {"unauthenticated", log.unauthenticated()},
                          {"lost", counts.lost},
                          {"doubled", counts.doubled},
                          {"reordered", counts.reordered},
                          {"of_other_masters", counts.of_other_masters},
                          {"implausible", counts.implausible},
                          {"resumed", counts.resumed},
                          {"sessions", counts.sessions}};
    if (counts.received == 0 && !log.empty()) {
      std::cerr << name << ": no message on " << contacts_channel << '\n';
    }
    for (const std::string& problem : log.problems()) std::cerr << problem << '\n';
    for (const LogDamage& damage : log.damages()) {
      report["damage"].push_back(
          {{"from", damage.begin}, {"to", damage.end}, {"what", damage.what}});
    }
    return log.damages().empty();
  }

  void finish(nlohmann::ordered_json& report) {
    notices_.tell_rest(std::cerr);
    for (const DegradedInterval& gap : time_line_.events().degraded()) {
      std::cerr << "events may be missing between t = " << gap.from << " and " << gap.to << '\n';
    }
    report["ticks"] = ticks_;
    report["settled_tick"] = time_line_.handed_out();
    report["flow_path"] = flow_path(stepper_);
    record_.to_json(report);
    record_.print(std::cerr);
    report.update(to_json(time_line_.events()));
    if (states_ && !states_->close()) throw std::runtime_error(states_->error());
    if (events_ && !events_->close()) throw std::runtime_error(events_->error());
  }

 private:
  bool done() const { return time_line_.started() && time_line_.handed_out() >= last_; }

  void take(const ContactReport& report, const Arrival& arrival, SessionTracker& sessions) {
    const EventCounts before = time_line_.events().counts();
    switch (sessions.hear(report, arrival)) {
      case SessionTracker::Verdict::ignored:
        raise_odd(sessions.oddity(), report, time_line_.events().horizon(), notices_);
        break;
      case SessionTracker::Verdict::starts:
        time_line_.restart(report);
        break;
      case SessionTracker::Verdict::resumes:
        notices_.raise(Notice::resumed, 1, time_line_.events().horizon(), report.horizon);
        time_line_.resume(report);
        break;
      case SessionTracker::Verdict::continues:
        time_line_.receive(report);
        break;
    }
    raise_skipped(time_line_.events(), before, notices_);
  }

  void settle() {
    if (events_) {
      for (; written_ < time_line_.events().counts().events; ++written_) {
        const auto& all = time_line_.events().events();
        const auto left = static_cast<std::size_t>(time_line_.events().counts().events - written_);
        events_->write(all[all.size() - left]);
      }
    }
    time_line_.run(
        0, [](const auto&) {},
        [&](const typename Stepper::State& state) {
          check_interrupt();
          if (state.tick > last_) return true;
          ++ticks_;
          const double t = tick_instant(state.tick, stepper_.h()).hi;
          confide(stepper_, state, time_line_.complete_to(t) ? initial_bound_ : infinity,
                  confidence_);
          record_.take(t, confidence_, initial_bound_, std::cerr);
          if (states_) {
            stepper_.output(state, q_, u_);
            to_columns(confidence_, initial_bound_, columns_);
            states_->write(state.tick, t, q_, u_, columns_);
          }
          return true;
        });
  }

  int contacts_;
  Stepper stepper_;
  TimeLine<Stepper> time_line_;
  double h_;
  std::int64_t last_;
  double duration_;
  Eigen::VectorXd q_, u_;
  double initial_bound_;
  Confidence confidence_;
  ConfidenceRecord record_;
  std::vector<double> columns_;
  std::optional<StatesWriter> states_;
  std::optional<EventsWriter> events_;
  Notices notices_;
  std::int64_t written_ = 0;
  std::int64_t ticks_ = 0;
};

template <typename Stepper>
int replay_with(const Scene& scene, const ObserverOptions& options, const ReplayOptions& options_of,
                const std::optional<Key>& key, nlohmann::ordered_json& report) {
  Replay<Stepper> replay(scene, options, options_of);
  bool whole = true;
  try {
    InputFile file(options_of.file);
    const bool is_log = is_lcm_log(file);
    whole = is_log ? replay.lcm_log(std::move(file), key, report)
                   : replay.events_csv(std::move(file), report);
  } catch (const Interrupted&) {
  }
  replay.finish(report);
  return whole ? exit_done : exit_failed;
}

}  // namespace

int run_replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay,
               const CommonOptions& common, nlohmann::ordered_json& report) {
  const std::optional<Key> key = key_of(common);
  return with_stepper(options.estimator, options.stepper, [&]<typename Stepper>() {
    return replay_with<Stepper>(scene, options, replay, key, report);
  });
}

}  // namespace sprag
