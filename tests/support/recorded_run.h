// The reference for a time line's output: an estimator driven by all events at once, without any
// code of the observer.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/scene_file.h"
#include "tests/support/random.h"

namespace sprag {

/// q, u and chi of ticks, in the order of output.
struct Recording {
  std::vector<std::int64_t> ticks;
  std::vector<ContactSet> chi;
  std::vector<Eigen::VectorXd> q, u;

  template <Estimator E>
  void add(E& estimator, const typename E::State& state, Eigen::Index f) {
    ticks.push_back(state.tick);
    chi.push_back(state.chi);
    q.emplace_back(f);
    u.emplace_back(f);
    estimator.output(state, q.back(), u.back());
  }
};

inline bool same_bits(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const auto bytes = static_cast<std::size_t>(a.size()) * sizeof(double);
  return a.size() == b.size() && (bytes == 0 || std::memcmp(a.data(), b.data(), bytes) == 0);
}

/// Empty if both are equal, bit for bit; otherwise the place of the first difference.
inline std::string difference(const Recording& expected, const Recording& actual) {
  const std::size_t n = std::min(expected.ticks.size(), actual.ticks.size());
  for (std::size_t i = 0; i < n; ++i) {
    const std::string where = "entry " + std::to_string(i) + ": ";
    if (expected.ticks[i] != actual.ticks[i]) {
      return where + "tick " + std::to_string(actual.ticks[i]) + " instead of " +
             std::to_string(expected.ticks[i]);
    }
    if (expected.chi[i] != actual.chi[i]) return where + "chi";
    if (!same_bits(expected.q[i], actual.q[i])) return where + "q";
    if (!same_bits(expected.u[i], actual.u[i])) return where + "u";
  }
  if (expected.ticks.size() == actual.ticks.size()) return "";
  return std::to_string(actual.ticks.size()) + " ticks instead of " +
         std::to_string(expected.ticks.size());
}

/// Runs from tick `first` to the last tick at or before `end`. `events` are those after the contact
/// state was `chi`.
template <Estimator E>
Recording offline(const Model& model, const State& start, double h,
                  std::span<const ContactEvent> events, double end, std::int64_t first = 0,
                  ContactSet chi = 0) {
  E estimator(model, h);
  typename E::State state;
  estimator.start(start, first, chi, state);
  const auto take_until = [&](std::int64_t k) {
    const auto later = std::find_if(events.begin(), events.end(), [&](const ContactEvent& event) {
      return tick_instant(k, h) - at(event.t) < 0.0;
    });
    const auto count = static_cast<std::size_t>(later - events.begin());
    const auto due = events.first(count);
    events = events.subspan(count);
    return due;
  };
  for_each_instant(take_until(first),
                   [&](std::span<const ContactEvent> of_one) { estimator.apply(of_one, state); });
  Recording recording;
  recording.add(estimator, state, model.coordinates());
  for (std::int64_t k = first + 1; tick_instant(k, h).hi <= end; ++k) {
    estimator.tick(take_until(k), state);
    recording.add(estimator, state, model.coordinates());
  }
  return recording;
}

/// A time line from t = 0 to `end` with ticks of h that receives `events` tick by tick. With `late`
/// it receives them after it has integrated further, and with additional rollbacks.
template <Estimator E, typename OnSettled>
void run_time_line(E& estimator, const Scene& scene, std::span<const ContactEvent> events,
                   double end, bool late, const OnSettled& on_settled) {
  TimeLine line(estimator, static_cast<int>(scene.model.contacts.size()), scene.prior.start, 30);
  line.restart(0, 0, 0, no_horizon);
  Random random(3);
  const auto settle = [&](std::int64_t target) {
    line.run(
        target, [](const auto&) {},
        [&](const auto& state) {
          on_settled(state);
          return true;
        });
  };
  const double h = estimator.h();
  for (std::int64_t k = 1; k <= last_tick(end, h); ++k) {
    const double t = tick_instant(k, h).hi;
    if (late) settle(k + 20);
    for (; !events.empty() && events.front().t <= t; events = events.subspan(1)) {
      line.receive(events.front());
    }
    line.set_horizon(t);
    if (late) settle(k + 20);
    if (late) line.go_back_to(line.now() - random.integer(1, 40));
  }
  settle(0);
}

/// A scene of scenes/, read once.
inline const Scene& cached_scene(std::string_view name) {
  static std::map<std::string, Scene, std::less<>> scenes;
  const auto found = scenes.find(name);
  if (found != scenes.end()) return found->second;
  return scenes
      .emplace(std::string(name),
               read_scene(std::filesystem::path(SPRAG_SOURCE_DIR) / "scenes" / name))
      .first->second;
}

inline std::vector<ContactEvent> master_events(const Scene& scene, double end) {
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  master.advance(at(end), events);
  return events;
}

/// The messages of a master that polls its clock at `times` (ascending).
inline std::vector<ContactMessage> reports_at(const std::vector<double>& times,
                                              std::span<const ContactEvent> events, int contacts,
                                              std::int64_t session = 1) {
  MessageBuilder builder(session, 1.0, contacts);
  std::vector<ContactMessage> reports;
  for (const double t : times) {
    std::size_t count = 0;
    while (count < events.size() && events[count].t <= t) ++count;
    builder.add(events.first(count));
    events = events.subspan(count);
    do reports.push_back(builder.next(t, 0));
    while (builder.pending());
  }
  return reports;
}

/// At every event, and at a distance of `heartbeat` up to `end`.
inline std::vector<double> event_and_heartbeat_times(std::span<const ContactEvent> events,
                                                     double heartbeat, double end) {
  std::vector<double> times{end};
  for (double t = 0.0; t < end; t += heartbeat) times.push_back(t);
  for (const ContactEvent& event : events) {
    if (event.t <= end) times.push_back(event.t);
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

/// The report of a sender that repeats only the last `count` records.
inline ContactMessage with_repeats(ContactMessage report, int count) {
  const int cut = std::max(report.records - count, 0);
  std::copy(report.record.begin() + cut, report.record.begin() + report.records,
            report.record.begin());
  report.records -= cut;
  return report;
}

}  // namespace sprag
