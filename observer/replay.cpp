#include "observer/replay.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "command_line/program.h"
#include "command_line/scene_inputs.h"
#include "lcmtypes/bus.h"
#include "observer/estimation.h"
#include "observer/notices.h"
#include "observer/settled_output.h"
#include "observer/wake.h"
#include "recording/recorded_events.h"
#include "recording/recording.h"
#include "recording/session_tracker.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/files/impacts_file.h"
#include "sprag/detail/files/predictions_file.h"
#include "sprag/detail/live/drive.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {
namespace {

// Limit of a replay without --duration: seconds of computing time, and 1e5 s with the default tick.
constexpr std::int64_t most_ticks = 100'000'000;

// In a replay all events of a tick are known in advance, so rollbacks go back one tick at most.
constexpr std::int64_t replay_history = 1;

class Replay {
 public:
  Replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay)
      : clock_(scene.clock),
        estimation_(scene, options, replay_history),
        settled_(options.states, estimation_.empty_sample(), estimation_.initial_bound,
                 scene.model.outputs),
        sample_(estimation_.empty_sample()),
        last_(options.last()),
        duration_(options.duration),
        events_(writer_of<EventsWriter>(replay.events)),
        impacts_file_(writer_of<ImpactsWriter>(options.impacts)),
        predictions_file_(writer_of<PredictionsWriter>(options.predictions)),
        ahead_(options.predict),
        verbose_(options.verbose) {
    if (predictions_file_) predictor_.emplace(scene.model);
    if (impacts_file_ || predictor_) estimation_.estimator.record_in(impacts_);
  }

  bool events_csv(const EventsFile& recorded, const std::string& name,
                  nlohmann::ordered_json& report) {
    if (recorded.damage) {
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
    if (!recorded.gaps.empty() && recorded.gaps.front().from <= until) {
      time_line_.degrade(recorded.gaps.front().from, std::min(recorded.gaps.back().to, until));
    }
    estimation_.set_end(until);
    time_line_.set_horizon(until);
    if (until > end) {
      std::cerr << name << ": no event after t = " << end
                << ": from there on the estimate runs free\n";
      report["runs_free_from"] = end;
    }
    if (!recorded.events.empty() || !std::isinf(duration_)) settle();
    return !recorded.damage;
  }

  bool lcm_log(InputFile file, const std::optional<Key>& key, nlohmann::ordered_json& report) {
    const std::string name = file.path().string();
    RecordedMessages log(std::move(file), estimation_.contacts, clock_, key);
    // The age of a recording does not matter.
    SessionTracker sessions(Freshness::any, estimation_.estimator.h());
    if (InputStream* stream = estimation_.stream.get()) {
      log.on_input([&sessions, stream, this](const InputMessage& message) {
        if (!time_line_.started() || message.session != sessions.session()) return;
        stream->take(message);
        settle();
      });
    }
    ContactMessage contacts;
    Arrival arrival;
    try {
      while (!done() && log.next(contacts, arrival)) {
        check_interrupt();
        take(contacts, arrival, sessions);
        notices_.print(monotonic_now(), std::cerr);
        settle();
      }
    } catch (const Interrupted&) {  // the settled ticks until then are valid
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
    for (const std::string& problem : log.problems(counts)) std::cerr << problem << '\n';
    for (const LogDamage& damage : log.damages()) {
      report["damage"].push_back(
          {{"from", damage.begin}, {"to", damage.end}, {"what", damage.what}});
    }
    return log.damages().empty();
  }

  void finish(nlohmann::ordered_json& report) {
    notices_.print_rest(std::cerr);
    report["ticks"] = settled_.ticks();
    estimation_.to_json(report);
    if (estimation_.stream) {
      estimation_.stream->print(std::cerr);
    } else {
      report_held_inputs(estimation_.of.scene, settled_.t());
    }
    settled_.sum_up(time_line_.events(), verbose_, report);
    settled_.close();
    if (events_) events_->finish();
    if (impacts_file_) impacts_file_->finish();
    if (predictions_file_) predictions_file_->finish();
  }

 private:
  bool done() const { return time_line_.started() && time_line_.handed_out() >= last_; }

  void take(const ContactMessage& report, const Arrival& arrival, SessionTracker& sessions) {
    const EventCounts before = time_line_.events().counts();
    switch (sessions.receive(report, arrival)) {
      case SessionTracker::Verdict::ignored:
        raise_odd(sessions.oddity(), report, time_line_.events().horizon(), notices_);
        break;
      case SessionTracker::Verdict::starts:
        estimation_.restart(report);
        break;
      case SessionTracker::Verdict::resumes:
        notices_.raise(Notice::resumed, 1, time_line_.events().horizon(), report.horizon);
        estimation_.receive(report, true);
        break;
      case SessionTracker::Verdict::continues:
        estimation_.receive(report, false);
        break;
    }
    raise_skipped(time_line_.events(), before, notices_);
  }

  void settle() {
    if (events_) {
      for (; written_ < time_line_.events().counts().events; ++written_) {
        const auto& all = time_line_.events().events();
        const auto left = static_cast<std::size_t>(time_line_.events().counts().events - written_);
        ContactEvent event = all[all.size() - left];
        event.t = clock_time(clock_, event.t);
        events_->write(event);
      }
    }
    if (settled_.writes_states() || !estimation_.estimator.coasts() || estimation_.stream) {
      run();
    } else {
      do {
        coast();
      } while (!run(1));
    }
    if (!settled_.writes_states() && settled_.ticks() > 0 && time_line_.handed_out() < last_) {
      conclude(time_line_.present());
    }
  }

  // Runs at most `ticks` ticks; true when everything up to the watermark has settled.
  bool run(std::int64_t ticks = std::numeric_limits<std::int64_t>::max()) {
    return sprag::settle(
        time_line_, last_,
        [&](const Estimation::State& state) {
          if (state.tick <= last_) show(state);
          return true;
        },
        ticks);
  }

  // Skips ticks without anything to note.
  void coast() {
    while (const std::int64_t ticks = time_line_.coast(last_ - 1)) {
      check_interrupt();
      settled_.pass(ticks, tick_instant(time_line_.now(), estimation_.estimator.h()).hi);
    }
  }

  void show(const Estimation::State& state) {
    if (impacts_file_) {
      for (const ImpactRecord& record : impacts_) impacts_file_->write(record);
    }
    if (predictor_ && !impacts_.empty()) {
      predictions_file_->write(estimation_.estimator.predict(state, *predictor_, ahead_));
    }
    impacts_.clear();
    if (settled_.writes_states()) {
      estimation_.describe(state, true, sample_);
      settled_.take(sample_);
    } else {
      estimation_.pass(state);
      estimation_.note(state, sample_);
      settled_.note(sample_);
      if (state.tick == last_) conclude(state);
    }
  }

  void conclude(const Estimation::State& state) {
    estimation_.describe(state, state.tick <= time_line_.settled_tick(), sample_);
    settled_.conclude(sample_);
  }

  ContactClock clock_;
  Estimation estimation_;
  TimeLine& time_line_ = estimation_.time_line;
  SettledOutput settled_;
  EstimateSample sample_;
  std::int64_t last_;
  double duration_;
  std::optional<EventsWriter> events_;
  std::vector<ImpactRecord> impacts_;  // of ticks that have not settled
  std::optional<ImpactsWriter> impacts_file_;
  std::optional<PredictionsWriter> predictions_file_;
  std::optional<Predictor> predictor_;
  double ahead_;
  bool verbose_;
  Notices notices_;
  std::int64_t written_ = 0;
};

// Throws InputError if a recording's last event is too far away, for example by a wrong time stamp.
// With --duration the user specifies the end.
void check_end(const EventsFile& recorded, const std::string& name,
               const ObserverOptions& options) {
  if (recorded.events.empty() || !std::isinf(options.duration)) return;
  const double end = recorded.events.back().t;
  if (last_tick(end, options.tick) <= most_ticks) return;
  std::ostringstream text;
  text << name << ": the last event is at t = " << end << ", beyond " << most_ticks << " ticks of "
       << options.tick << ": give --duration, or a larger --tick";
  throw InputError(text.str());
}

// Reads and checks the file before any output is opened, so that a refused file overwrites nothing.
EventsFile read_checked(InputFile file, const Scene& scene, const ObserverOptions& options) {
  const std::string name = file.path().string();
  std::vector<std::string> problems;
  EventsFile recorded =
      read_machine_events(std::move(file), static_cast<int>(scene.model.contacts.size()),
                          options.duration, scene.clock, problems);
  for (const std::string& problem : problems) std::cerr << problem << '\n';
  check_end(recorded, name, options);
  return recorded;
}

}  // namespace

int run_replay(const Scene& scene, const ObserverOptions& options, const ReplayOptions& replay,
               const CommonOptions& common, nlohmann::ordered_json& report) {
  const std::optional<Key> key = key_of(common);
  std::optional<InputFile> log(std::in_place, replay.file);
  std::optional<EventsFile> csv;
  bool interrupted = false;
  try {
    if (!is_lcm_log(*log)) {
      csv = read_checked(*std::exchange(log, std::nullopt), scene, options);
    }
  } catch (const Interrupted&) {
    interrupted = true;
  }
  // Events without their input: the record of the scene is the excitation.
  Scene of_record = scene;
  if (csv && scene.stream_duration > 0.0) {
    of_record.stream_duration = 0.0;
    if (std::isfinite(options.duration)) {
      require_inputs_until(scene, options.duration, "--duration");
    }
  }
  Replay run(of_record, options, replay);
  bool whole = true;
  try {
    if (csv) {
      whole = run.events_csv(*csv, replay.file.string(), report);
    } else if (!interrupted) {
      whole = run.lcm_log(std::move(*log), key, report);
    }
  } catch (const Interrupted&) {
  }
  run.finish(report);
  return whole ? exit_done : exit_failed;
}

}  // namespace sprag
