#include "recording/recorded_events.h"

#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "recording/recording.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/files/events_writer.h"

namespace sprag {
namespace {

constexpr std::size_t usual_events = 4096;
// A session whose first watermark is later than this does not start at t = 0, since a machine's
// clock may start anywhere. The same limit as of an observer with ticks of 1e-3.
constexpr double near = 100.0;  // s

RecordedEvents read_csv(InputFile file, int contacts, double end, const ContactClock& clock) {
  RecordedEvents recorded;
  EventsFile of_file =
      read_machine_events(std::move(file), contacts, end, clock, recorded.problems);
  recorded.events = std::move(of_file.events);
  recorded.gaps = std::move(of_file.gaps);
  recorded.whole = !of_file.damage;
  return recorded;
}

RecordedEvents read_log(InputFile file, int contacts, AfterLoss after_loss,
                        const std::optional<Key>& key, const ContactClock& clock) {
  RecordedEvents recorded;
  const std::string name = file.path().string() + ": ";
  RecordedMessages log(std::move(file), contacts, clock, key);
  SessionTracker sessions;
  EventHistory history(contacts, usual_events);
  std::size_t earlier_gaps = 0;  // gaps of earlier sessions
  ContactMessage message;
  Arrival arrival;
  while (log.next(message, arrival)) {
    const auto verdict = sessions.receive(message, arrival);
    if (verdict == SessionTracker::Verdict::ignored) continue;
    if (verdict == SessionTracker::Verdict::starts) {
      history.restart(0, 0, no_horizon);
      // A recording that begins later lacks the events before.
      if (message.records_total > message.records || message.horizon > near) {
        history.restart(message.records_total, message.closed, message.horizon);
        recorded.begins = message.horizon;
        recorded.closed = message.closed;
      } else {
        recorded.begins = 0.0;
        recorded.closed = 0;
      }
      earlier_gaps = history.degraded().size();
    }
    // If the clock or the counts went back, record numbers have lost their meaning: events may be
    // missing.
    const bool back =
        message.horizon < history.horizon() || message.records_total < history.next_record();
    if (verdict == SessionTracker::Verdict::resumes && back) {
      history.degrade(history.horizon(), message.horizon);
    }
    history.add(message);
  }
  recorded.sessions = sessions.counts().sessions;
  if (sessions.counts().received == 0 && !log.empty()) {
    recorded.problems.push_back(name + "no message of a machine with " + std::to_string(contacts) +
                                (contacts == 1 ? " contact" : " contacts"));
  }
  if (recorded.sessions > 1) {
    recorded.problems.push_back(name + std::to_string(recorded.sessions) +
                                " runs of a master; the last is used");
  }
  recorded.events = history.events();
  if (recorded.begins > 0.0) {
    std::ostringstream text;
    text << name << "begins at t = " << recorded.begins << ": earlier events are unknown";
    recorded.problems.push_back(text.str());
  }
  for (std::size_t i = earlier_gaps; i < history.degraded().size(); ++i) {
    const EventGap gap = {history.degraded()[i].from, history.degraded()[i].to};
    std::ostringstream text;
    text << name << "events may be missing from t = " << gap.from;
    if (after_loss == AfterLoss::dropped) {
      text << " on; everything before is used";
      recorded.problems.push_back(text.str());
      std::erase_if(recorded.events, [&](const ContactEvent& event) { return event.t > gap.from; });
      break;
    }
    text << " to " << gap.to;
    recorded.problems.push_back(text.str());
    add(gap, recorded.gaps);
  }
  recorded.whole = log.damages().empty();
  for (std::string& problem : log.problems(sessions.counts()))
    recorded.problems.push_back(std::move(problem));
  return recorded;
}

}  // namespace

EventsFile read_machine_events(InputFile file, int contacts, double end, const ContactClock& clock,
                               std::vector<std::string>& problems) {
  const std::string name = file.path().string();
  const auto at_line = [&](const FileProblem& problem) {
    return name + ':' + std::to_string(problem.line) + ": ";
  };
  EventsFile events = read_events(std::move(file), contacts);
  if (events.implausible && !std::isfinite(end)) {
    const FileProblem& problem = events.implausible->problem;
    throw InputError(at_line(problem) + problem.what +
                     " Correct or remove the row, shift all times (import_events --offset), or "
                     "give --duration, up to which events count");
  }
  if (const std::size_t before = to_machine_time(clock, events); before > 0) {
    std::ostringstream text;
    text << name << ": " << before << (before == 1 ? " event" : " events")
         << " before the machine's t = 0, by clock.offset = " << clock.offset << ", left out";
    problems.push_back(text.str());
  }
  for (const FileProblem& row : events.skipped)
    problems.push_back(at_line(row) + "skipped: " + row.what);
  if (events.damage)
    problems.push_back(at_line(*events.damage) + events.damage->what +
                       "; everything before is used");
  return events;
}

RecordedEvents read_recorded_events(const std::filesystem::path& file, int contacts, double end,
                                    AfterLoss after_loss, const std::optional<Key>& key,
                                    const ContactClock& clock) {
  InputFile input(file);
  const bool is_log = is_lcm_log(input);
  RecordedEvents recorded = is_log ? read_log(std::move(input), contacts, after_loss, key, clock)
                                   : read_csv(std::move(input), contacts, end, clock);
  std::erase_if(recorded.events, [&](const ContactEvent& event) { return event.t > end; });
  return recorded;
}

RecordedEvents read_recorded_events(const std::filesystem::path& file, const Scene& scene,
                                    double end, AfterLoss after_loss, const CommonOptions& common,
                                    nlohmann::ordered_json& report) {
  RecordedEvents recorded =
      read_recorded_events(file, static_cast<int>(scene.model.contacts.size()), end, after_loss,
                           key_of(common), scene.clock);
  for (const std::string& problem : recorded.problems) std::cerr << problem << '\n';
  report["problems"] = recorded.problems;
  return recorded;
}

}  // namespace sprag
