// B >= V at every tick on random machines. The observer receives their events late, out of order
// and with gaps, and of one run of the master after another.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <optional>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/energy.h"
#include "tests/support/by_speed.h"
#include "tests/support/flight_norm.h"
#include "tests/support/random_model.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

constexpr std::uint64_t first_seed = 1301;
constexpr int machines = 100;
constexpr double trial_end = 5.0;
constexpr double heartbeat = 0.02;
constexpr std::size_t most_events = 20000;

/// One run of a master: its events, and its state at every tick.
struct Run {
  std::vector<ContactEvent> events;
  std::vector<State> truth;
};

std::optional<Run> run_of(const Model& model, const State& start, double h) {
  Run run;
  Master master(model, start);
  State state = start;
  try {
    for (std::int64_t k = 0; k <= last_tick(trial_end, h); ++k) {
      if (!master.advance(tick_instant(k, h), run.events, most_events - run.events.size())) {
        return std::nullopt;
      }
      master.state(tick_instant(k, h), state.q, state.u);
      run.truth.push_back(state);
    }
  } catch (const SimulationError&) {  // no progress
    return std::nullopt;
  }
  return run;
}

struct Arriving {
  double at;
  ContactMessage report;
};

/// Reports of a run that arrive with a delay of up to `delay`, in any order. None arrives from
/// `lost_from` to `lost_to`, and the later ones do not repeat the lost records.
std::vector<Arriving> arrivals(Random& random, const Run& run, int contacts, double delay,
                               double lost_from, double lost_to, std::int64_t session) {
  std::vector<Arriving> all;
  for (const ContactMessage& report :
       reports_at(event_and_heartbeat_times(run.events, heartbeat, trial_end), run.events, contacts,
                  session)) {
    if (report.horizon > lost_from && report.horizon < lost_to) continue;
    const bool repeats = report.horizon <= lost_from;
    all.push_back(
        {report.horizon + random.uniform(0.0, delay), repeats ? report : with_repeats(report, 1)});
  }
  std::sort(all.begin(), all.end(),
            [](const Arriving& a, const Arriving& b) { return a.at < b.at; });
  return all;
}

/// The bound over a session.
struct Said {
  int finite = 0, infinite = 0;           // ticks
  double highest = 0.0, last = infinity;  // B / B(0)
  double closest = 0.0;                   // largest V / B
};

class BoundFollower {
 public:
  BoundFollower(const Model& model, const State& replica, double h)
      : replica_(model, h),
        line_(replica_, static_cast<int>(model.contacts.size()), replica, 40),
        energy_(model),
        state_(replica) {
    scene_.model = model;
    scene_.prior.start = replica;
  }

  /// `received`: number of received arrivals, before the master ends.
  Said follow(const Run& run, const State& master, const State& replica,
              const std::vector<Arriving>& arriving, std::size_t received) {
    Said said;
    const double V0 = energy_(master.q, master.u, replica.q, replica.u)[0];
    const Eigen::Index f = replica.q.size();
    scene_.prior.uncertainty = Eigen::VectorXd::Constant(f, V0 / static_cast<double>(f));
    BoundTracker tracker(scene_, replica_.flows(), line_.h());
    line_.restart(arriving.front().report);
    for (std::size_t i = 0; i < received; ++i) {
      if (i > 0 && line_.receive(arriving[i].report)) break;
      const std::int64_t now = std::min(last_tick(arriving[i].at, line_.h()),
                                        static_cast<std::int64_t>(run.truth.size()) - 1);
      line_.run(
          now, [](const TrackingState&) {},
          [&](const TrackingState& state) {
            check(state, run, V0, tracker, said);
            return true;
          });
    }
    return said;
  }

  std::int64_t rollbacks() const { return line_.rollbacks().rollbacks; }
  std::int64_t contradicting() const { return line_.events().counts().of(Skip::contradicting); }
  std::int64_t lost() const { return line_.events().counts().lost_records; }

 private:
  void check(const TrackingState& state, const Run& run, double V0, BoundTracker& tracker,
             Said& said) {
    const double t = tick_instant(state.tick, line_.h()).hi;
    const State& truth = run.truth.at(static_cast<std::size_t>(state.tick));
    replica_.output(state, state_.q, state_.u);
    const double V = energy_(truth.q, truth.u, state_.q, state_.u)[0];
    tracker.follow(line_, t);
    const double B = tracker.bound(line_, t, state_.q, state_.u);
    EXPECT_LE(V, B) << "t = " << t;
    ++(std::isfinite(B) ? said.finite : said.infinite);
    said.last = B / V0;
    said.highest = std::max(said.highest, said.last);
    said.closest = std::max(said.closest, V / B);
  }

  Scene scene_;
  ReplicaEstimator replica_;
  TimeLine line_;
  ErrorEnergy energy_;
  State state_;
};

/// Share of an energy that remains after the flights of a run, at most: prod |exp(A tau)|^2.
/// Contact phases count as no decay.
double left_by_flights(const Run& run, const FlightNorm& norm) {
  double left = 1.0;
  double since = 0.0;
  ContactSet chi = 0;
  const auto land = [&](double t) {
    if (chi == 0 && t > since) left *= norm.square(t - since);
  };
  for_each_instant(std::span<const ContactEvent>(run.events),
                   [&](std::span<const ContactEvent> of_one) {
                     land(of_one.front().t);
                     for (const ContactEvent& event : of_one) chi = after(chi, event);
                     since = of_one.front().t;
                   });
  land(trial_end);
  return left;
}

struct Totals {
  std::map<std::string, int> paths;
  int kept = 0, left_out = 0, several = 0, gaps = 0, recovered = 0, whole = 0;
  std::int64_t rollbacks = 0, ticks = 0, events = 0, closings = 0;
  double closest = 0.0, highest = 0.0;
  double fallen = 0.0, fallen_by_flights = 0.0;  // sums of log10, machines of one contact
};

/// Three runs of the master of a machine. The first ends early, the second has a gap. False if one
/// of them makes no progress.
bool take(Random& random, const ImpactingMachine& machine, Totals& totals) {
  const Model& model = machine.model;
  const auto m = static_cast<int>(model.contacts.size());
  const double h = random.log_uniform(5e-3, 3e-2);
  const State replica = random_state(random, model);
  const Flows flows(model);
  const FlightNorm norm(flows);
  BoundFollower observer(model, replica, h);
  for (int session = 1; session <= 3; ++session) {
    State start = machine.start;
    start.u *= random.uniform(-1.0, 1.0);
    const auto run = run_of(model, start, h);
    if (!run) return false;
    const bool lossy = session == 2;
    const double lost_from = lossy ? random.uniform(0.2, 0.6) * trial_end : infinity;
    const auto arriving = arrivals(random, *run, m, random.log_uniform(1e-3, 1.0), lost_from,
                                   lost_from + 0.3 * trial_end, session);
    const std::size_t received = session == 1 ? arriving.size() * 2 / 3 : arriving.size();
    const std::int64_t lost_before = observer.lost();
    const Said said = observer.follow(*run, start, replica, arriving, received);
    totals.ticks += said.finite;
    totals.events += static_cast<std::int64_t>(run->events.size());
    totals.closings += std::count_if(
        run->events.begin(), run->events.end(),
        [](const ContactEvent& event) { return event.kind == ContactEventKind::closes; });
    totals.closest = std::max(totals.closest, said.closest);
    if (observer.lost() > lost_before) {
      if (!lossy) continue;  // reports that were overtaken
      ++totals.gaps;
      if (std::isfinite(said.last)) ++totals.recovered;
      continue;
    }
    if (said.infinite > 0) continue;  // a report came too late
    ++totals.whole;
    // Joint impacts with restitutions by speed may expand distances.
    if (m == 1 || !has_curves(model)) {
      EXPECT_LT(said.highest, 1.5);
      totals.highest = std::max(totals.highest, said.highest);
    }
    if (m > 1 || session == 1) continue;
    const double expected = left_by_flights(*run, norm);
    EXPECT_LT(std::sqrt(said.last), std::pow(expected, 0.43) + 1e-4);
    totals.fallen += std::log10(said.last);
    totals.fallen_by_flights += std::log10(expected + 1e-8);
  }
  EXPECT_EQ(observer.contradicting(), 0);
  totals.rollbacks += observer.rollbacks();
  if (m > 1) ++totals.several;
  ++totals.paths[name(flows[0].path())];
  return true;
}

TEST(ExactBoundTrial, HoldsAtEveryTickOfRandomMachines) {
  std::cout << "seed " << first_seed << '\n';
  Random random(first_seed);
  Totals totals;
  for (int number = 0; totals.kept < repetitions(machines); ++number) {
    SCOPED_TRACE("machine " + std::to_string(number));
    ImpactingMachine machine = random_impacting_machine(random);
    Random of_curves(first_seed + 1 + static_cast<std::uint64_t>(number));
    if (number % 3 == 0) test::let_restitutions_fall(of_curves, 3.0, machine.model);
    ++(take(random, std::move(machine), totals) ? totals.kept : totals.left_out);
  }
  std::cout << totals.kept << " machines (";
  for (const auto& [path, count] : totals.paths) std::cout << count << ' ' << path << ", ";
  std::cout << totals.several << " with several contacts; " << totals.left_out << " left out), "
            << totals.ticks << " ticks, " << totals.events << " events (" << totals.closings
            << " close to stay), " << totals.rollbacks << " rollbacks, " << totals.gaps << " gaps, "
            << totals.recovered << " with a finite bound after them; largest V/B " << totals.closest
            << ", largest B/B(0) " << totals.highest << ", of one contact B fell by "
            << -totals.fallen << " decades, by the flights alone " << -totals.fallen_by_flights
            << '\n';
  EXPECT_EQ(totals.paths.size(), 3U);
  EXPECT_GT(totals.rollbacks, 5 * totals.kept);
  if (sanitized) return;  // too few machines to count what they meet
  EXPECT_GT(totals.gaps, totals.kept / 4);
  EXPECT_GT(totals.recovered, totals.gaps / 4);
  EXPECT_GT(totals.whole, totals.kept);
  EXPECT_GT(totals.closest, 0.9);
  EXPECT_LT(totals.fallen, 0.9 * totals.fallen_by_flights);
}

}  // namespace
}  // namespace sprag
