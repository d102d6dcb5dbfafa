#include "sprag/detail/live/time_line.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <tuple>

#include "sprag/detail/replica/replica.h"
#include "tests/support/random.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

using enum ContactEventKind;

/// A target as far ahead of the settled ticks as a run allows.
constexpr std::int64_t far_ahead = std::numeric_limits<std::int64_t>::max() / 2;
constexpr auto ignore = [](const auto&) {};

/// The paper's beam with a second contact.
Model two_contacts() {
  Model model = cached_scene("paper_beam.toml").model;
  Contact second;
  second.w = Eigen::Vector3d(1.0, 0.5, -0.3);
  second.restitution = 0.7;
  model.contacts.push_back(second);
  return model;
}

/// A time line of the two-contact beam and its output.
template <typename E>
struct LineRun {
  explicit LineRun(double h, std::int64_t history, const Model& model = two_contacts())
      : estimator(model, h),
        f(model.coordinates()),
        lead(history),
        line(estimator, static_cast<int>(model.contacts.size()),
             cached_scene("paper_beam.toml").prior.start, history) {}

  /// Started at t = 0 with complete events.
  LineRun& start() {
    line.restart(0, 0, 0, no_horizon);
    return *this;
  }

  void to(std::int64_t target, std::int64_t budget = std::numeric_limits<std::int64_t>::max()) {
    if (target == far_ahead) target = line.settled_tick() + lead;
    arrived = line.run(
        target, [this](const auto& state) { seen.push_back(state.tick); },
        [this](const auto& state) {
          settled.add(estimator, state, f);
          return true;
        },
        budget);
  }

  /// Receives the events up to `t`, which is the new watermark.
  void receive_until(std::span<const ContactEvent> events, double t) {
    for (; next < events.size() && events[next].t <= t; ++next) line.receive(events[next]);
    line.set_horizon(t);
  }

  E estimator;
  Eigen::Index f;
  std::int64_t lead;  ///< ticks
  TimeLine line;
  Recording settled;
  std::vector<std::int64_t> seen;
  std::size_t next = 0;  ///< of receive_until()
  bool arrived = false;
};

using ReplicaLine = LineRun<ReplicaEstimator>;  // for what no estimator influences

template <typename E>
class TimeLineTest : public ::testing::Test {
 protected:
  static Recording reference(double h, std::span<const ContactEvent> events, double end,
                             std::int64_t first = 0, ContactSet chi = 0) {
    return offline<E>(two_contacts(), cached_scene("paper_beam.toml").prior.start, h, events, end,
                      first, chi);
  }

  /// Events one by one, all after the settled ticks, with `target` after each.
  static Recording one_by_one(double h, const std::vector<ContactEvent>& events, double end,
                              std::int64_t target, RollbackCounts& counts) {
    LineRun<E> run(h, 100);
    EXPECT_FALSE(run.line.started());
    run.to(far_ahead);
    EXPECT_TRUE(run.seen.empty()) << "idle before the start";
    run.start().to(target);
    for (std::size_t i = 0; i < events.size(); ++i) {
      run.line.receive(events[i]);
      run.to(target);
      const bool last_of_instant = i + 1 == events.size() || events[i + 1].t != events[i].t;
      if (last_of_instant) run.line.set_horizon(events[i].t);
    }
    run.line.set_horizon(end);
    run.to(target);
    counts = run.line.rollbacks();
    return run.settled;
  }
};

// Exact event times are those of the whole observer with a network.
using Estimators = ::testing::Types<ReplicaEstimator, JitteringBoth>;
TYPED_TEST_SUITE(TimeLineTest, Estimators);

TYPED_TEST(TimeLineTest, RollbackAtEveryTickDoesNotChangeResult) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double h = seed % 2 == 0 ? 1e-2 : 1.0 / 64;
    const double spacing = h * random.log_uniform(0.1, 3.0);
    const double from = seed % 3 == 0 ? 0.0 : random.uniform(0.0, 0.1);
    const auto events = random_events(random, 2, repetitions(200), from, spacing);
    const double end = events.back().t + 0.2;
    const Recording expected = this->reference(h, events, end);
    RollbackCounts ahead, in_order;
    EXPECT_EQ(difference(expected, this->one_by_one(h, events, end, far_ahead, ahead)), "");
    EXPECT_EQ(difference(expected, this->one_by_one(h, events, end, 0, in_order)), "");
    EXPECT_GE(ahead.rollbacks, static_cast<std::int64_t>(events.size()) - 1);
    EXPECT_LE(in_order.depth.largest(), 1);
  }
}

// k h is not always a double. The tick's exact time decides, also for the watermark.
TEST(TimeLine, AnEventNextToATickBelongsToTheFirstTickNotBeforeIt) {
  for (const double h : {1e-3, 0.125}) {
    for (std::int64_t k = 1; k < 200; ++k) {
      const double rounded = static_cast<double>(k) * h;
      for (const double t : {std::nextafter(rounded, 0.0), rounded, std::nextafter(rounded, 1e9)}) {
        ReplicaLine run(h, 10);
        run.start().line.receive(ContactEvent{t, 0, closes});
        run.line.set_horizon(t);
        run.to(0);
        EXPECT_EQ(run.line.settled_tick(), tick_instant(k, h).hi <= t ? k : k - 1) << k;
        run.line.set_horizon(1.5 * h + rounded);
        run.to(0);
        EXPECT_EQ(run.settled.chi[static_cast<std::size_t>(k)],
                  tick_instant(k, h) - at(t) >= 0.0 ? 1U : 0U)
            << k;
      }
    }
  }
}

TYPED_TEST(TimeLineTest, AnEventAtTheStartActsAtTheStart) {
  const std::vector<ContactEvent> events{
      {0.0, 0, closes}, {0.004, 1, pulse}, {0.05, 0, opens}, {0.05, 1, closes}};
  for (const bool late : {false, true}) {
    LineRun<TypeParam> run(1e-2, 100);
    run.start();
    if (late) run.to(20);
    for (const ContactEvent& event : events) {
      run.line.receive(event);
      if (late) run.to(20);
    }
    run.line.set_horizon(0.2);
    run.to(20);
    EXPECT_EQ(run.settled.chi[0], 1U);
    EXPECT_EQ(difference(this->reference(1e-2, events, 0.2), run.settled), "") << late;
  }
}

TYPED_TEST(TimeLineTest, SimultaneousEventsAreOneImpactInAnyOrderOfArrival) {
  const std::vector<ContactEvent> events{{0.3, 0, pulse}, {0.3, 1, pulse}};
  const Recording expected = this->reference(0.25, events, 1.0);
  for (const bool apart : {false, true}) {
    LineRun<TypeParam> run(0.25, 10);
    run.line.restart(0, 0, 0, no_horizon);
    run.line.receive(events[0]);
    if (apart) run.to(4);
    run.line.receive(events[1]);
    run.line.set_horizon(1.0);
    run.to(4);
    EXPECT_EQ(difference(expected, run.settled), "") << apart;
  }
}

TEST(TimeLine, SuccessiveImpactsAreNotMerged) {
  const State& start = cached_scene("paper_beam.toml").prior.start;
  const std::vector<ContactEvent> once{{0.3, 0, pulse}, {0.3, 1, pulse}};
  const std::vector<ContactEvent> twice{{0.3, 0, pulse}, {std::nextafter(0.3, 1.0), 1, pulse}};
  EXPECT_NE(difference(offline<ReplicaEstimator>(two_contacts(), start, 0.25, once, 1.0),
                       offline<ReplicaEstimator>(two_contacts(), start, 0.25, twice, 1.0)),
            "");
}

// Skipped ticks lose nothing: neither motion nor notes of note(). The machine has sustained
// contacts, pulses and chatter.
TEST(TimeLine, SkippedTicksDoNotChangeMotionOrNotes) {
  const auto said = [](const ReplicaEstimator& replica, const TrackingState& state) {
    Confidence confidence;
    replica.note(state, confidence);
    return std::tuple(confidence.replica.t, confidence.replica.gap, confidence.redundancy.closings,
                      confidence.refused_impacts);
  };
  const Scene& scene = cached_scene("paper_beam.toml");
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double h = seed % 2 == 0 ? 1e-2 : 1.0 / 64;
    const auto events = random_events(random, 2, 200, 0.0, h * random.log_uniform(0.3, 100.0));
    const double end = events.back().t + 0.5;
    const Recording expected =
        offline<ReplicaEstimator>(two_contacts(), scene.prior.start, h, events, end);

    ReplicaEstimator replica(two_contacts(), h);
    TrackingState last_shown;
    TimeLine line(replica, 2, scene.prior.start, 5);
    line.restart(0, 0, 0, no_horizon);
    std::int64_t shown = 0, coasted = 0;
    std::size_t next = 0;
    for (double t = 0.0; line.handed_out() < last_tick(end, h);) {
      t = std::min(t + random.log_uniform(h, 300.0 * h), end);
      for (; next < events.size() && events[next].t <= t; ++next) line.receive(events[next]);
      line.set_horizon(t);
      bool arrived = false;
      while (!arrived) {
        const std::int64_t last = line.now() + random.integer(0, 100);
        if (const std::int64_t ticks = line.coast(last); ticks > 0) {
          coasted += ticks;
          EXPECT_LE(line.now(), last);
          EXPECT_EQ(line.handed_out(), line.now());
          EXPECT_EQ(said(replica, line.present()), said(replica, last_shown));
          const auto k = static_cast<std::size_t>(line.now());
          Recording present;
          present.add(replica, line.present(), 3);
          EXPECT_TRUE(same_bits(present.q[0], expected.q[k])) << "tick " << k;
          EXPECT_TRUE(same_bits(present.u[0], expected.u[k])) << "tick " << k;
        }
        arrived = line.run(
            0, ignore,
            [&](const TrackingState& state) {
              ++shown;
              last_shown = state;
              Recording present;
              present.add(replica, state, 3);
              const auto k = static_cast<std::size_t>(state.tick);
              EXPECT_TRUE(same_bits(present.q[0], expected.q[k])) << "tick " << k;
              EXPECT_TRUE(same_bits(present.u[0], expected.u[k])) << "tick " << k;
              return true;
            },
            random.integer(1, 3));
      }
    }
    EXPECT_EQ(shown + coasted, static_cast<std::int64_t>(expected.ticks.size()));
    EXPECT_GT(coasted, 0);
  }
}

TYPED_TEST(TimeLineTest, EventsOlderThanHistoryDoNotChangeResult) {
  for (const std::int64_t history : {1, 2, 7, 100}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE("history " + std::to_string(history) + " seed " + std::to_string(seed));
      Random random(seed);
      const double h = 1.0 / 64;
      const auto events = random_events(random, 2, 60, seed % 3 == 0 ? 0.0 : 0.5, 0.03);
      const double end = events.back().t + 0.5;
      LineRun<TypeParam> run(h, history);
      run.lead = 10 * history + 20;
      run.start().to(far_ahead);
      for (double t = 0.0; t < end; t += random.uniform(0.0, 1.0)) {
        run.receive_until(events, t);
        run.to(far_ahead);
        EXPECT_EQ(run.line.now(), run.line.settled_tick() + run.lead);
        EXPECT_EQ(run.line.handed_out(), run.line.settled_tick());
      }
      run.receive_until(events, end);
      run.to(0);
      EXPECT_EQ(difference(this->reference(h, events, end), run.settled), "");
      EXPECT_GT(run.line.rollbacks().beyond_history, 0);
      for (std::size_t k = 0; k < run.seen.size(); ++k)
        ASSERT_EQ(run.seen[k], static_cast<std::int64_t>(k));
    }
  }
}

// GGPO's SyncTest: a rollback has no visible effect.
TYPED_TEST(TimeLineTest, RollbackWithoutLateEventDoesNotChangeResult) {
  const Scene& scene = cached_scene("paper_beam_chatter.toml");
  const double h = 1e-2;
  const double end = 12.0;
  const auto events = master_events(scene, end);
  for (const std::int64_t history : {3, 40}) {
    Random random(static_cast<std::uint64_t>(history));
    LineRun<TypeParam> run(h, history, scene.model);
    run.lead = 2 * history;
    run.start();
    for (std::int64_t k = 0; k <= last_tick(end, h); ++k) {
      run.receive_until(events, tick_instant(k, h).hi);
      run.to(far_ahead);
      run.line.go_back_to(run.line.now() - random.integer(1, static_cast<int>(3 * history)));
      EXPECT_LT(run.line.now(), run.line.settled_tick() + run.lead);
    }
    run.to(far_ahead);
    EXPECT_EQ(
        difference(offline<TypeParam>(scene.model, scene.prior.start, h, events, end), run.settled),
        "")
        << "history " << history;
  }
}

TYPED_TEST(TimeLineTest, BudgetDoesNotChangeResult) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double h = 1.0 / 64;
    const auto events = random_events(random, 2, 100, 0.0, 0.03);
    const double end = events.back().t;
    LineRun<TypeParam> run(h, 20);
    run.start();
    double t = 0.0;
    int unfinished = 0;
    while (run.line.handed_out() < last_tick(end, h)) {
      t = std::min(t + random.uniform(0.0, 0.1), end);
      run.receive_until(events, t);
      const std::int64_t before = run.line.now();
      run.to(last_tick(t, h) + 30, 8);
      EXPECT_LE(run.line.now(), before + 8);
      EXPECT_EQ(run.arrived, run.line.now() >= last_tick(t, h) + 30);
      if (!run.arrived) ++unfinished;
    }
    EXPECT_GT(unfinished, 10);
    EXPECT_EQ(difference(this->reference(h, events, end), run.settled), "");
  }
}

TYPED_TEST(TimeLineTest, StartsAtZeroWhenTheFirstReportCarriesEveryRecord) {
  Random random(5);
  const auto events = random_events(random, 2, max_records - 1, 0.0, 0.01);
  const std::size_t carried = std::min<std::size_t>(events.size(), max_records);
  const auto first_events = std::span(events).first(carried);
  const double t = first_events.back().t + 0.001;
  const auto report = reports_at({t}, first_events, 2).front();
  ASSERT_EQ(report.records, report.records_total);
  LineRun<TypeParam> run(1e-2, 30);
  run.line.restart(report);
  run.to(far_ahead);
  EXPECT_EQ(difference(this->reference(1e-2, first_events, t), run.settled), "");
}

TYPED_TEST(TimeLineTest, StartsAfterTheHorizonWhenTheFirstReportDoesNotCarryEveryRecord) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double h = 1.0 / 64;
    const auto events = random_events(random, 2, 400, 0.0, 0.01);
    const auto times = event_and_heartbeat_times(events, 0.01, events.back().t + 0.1);
    const auto reports = reports_at(times, events, 2);
    std::size_t joined = 0;
    while (reports[joined].records_total <= max_records + 10 * static_cast<int>(seed)) ++joined;
    const double horizon = reports[joined].horizon;
    const std::int64_t first = last_tick(horizon, h) + 1;
    LineRun<TypeParam> run(h, 30);
    run.line.restart(reports[joined]);
    EXPECT_EQ(run.line.now(), first);
    run.to(far_ahead);
    for (std::size_t i = joined + 1; i < reports.size(); ++i) {
      run.line.receive(reports[i]);
      run.to(random.chance(0.5) ? far_ahead : 0);
    }
    const auto taken = static_cast<std::size_t>(reports[joined].records_total);
    EXPECT_EQ(difference(this->reference(h, std::span(events).subspan(taken), times.back(), first,
                                         chi_after(events, taken)),
                         run.settled),
              "");
    EXPECT_EQ(run.seen.front(), first);
  }
}

TEST(TimeLine, StartsAfterDistantHorizon) {
  const double h = 1e-3;
  for (const double t : {99.9995, 100.0005, 100.0015, 1e5, 1e7, 1.7e9}) {
    ReplicaLine run(h, 30);
    run.line.restart(reports_at({t}, {}, 2).front());
    EXPECT_EQ(run.line.now(), t < 100.001 ? 0 : last_tick(t, h) + 1) << t;
  }
}

ContactMessage report_of(std::int64_t total, double horizon) {
  ContactMessage made;
  made.contacts = 2;
  made.records_total = total;
  made.horizon = horizon;
  made.closed = total == 1 ? 1 : 0;
  return made;
}

// Events in a long gap are unknown, so that integrating through it is pointless.
TEST(TimeLine, RestartsAfterLongGap) {
  ReplicaLine run(1e-2, 30);
  run.line.restart(report_of(0, 1.0));
  run.to(0);
  EXPECT_FALSE(run.line.receive(report_of(3, 900.0)));
  run.to(0);
  EXPECT_EQ(run.line.handed_out(), 90000);
  EXPECT_TRUE(run.line.receive(report_of(6, 2000.0)));
  EXPECT_EQ(run.line.now(), 200001);
  EXPECT_EQ(run.line.events().counts().lost_records, 6);
  EXPECT_FALSE(run.line.receive(report_of(6, 9000.0)));  // no record was lost
  EXPECT_EQ(run.line.now(), 200001);
}

TEST(TimeLine, ContinuesAfterForwardClockStepAndRestartsAfterBackwardOne) {
  ReplicaLine run(1e-2, 30);
  run.line.restart(report_of(0, 5.0));
  run.to(0);
  EXPECT_FALSE(run.line.resume(report_of(0, 30.0)));
  run.to(0);
  EXPECT_EQ(run.line.handed_out(), 3000);
  EXPECT_TRUE(run.line.resume(report_of(1, 10.0)));
  EXPECT_EQ(run.line.now(), 1001);
  EXPECT_EQ(run.line.events().horizon(), 10.0);
  EXPECT_TRUE(run.line.resume(report_of(1, 1e6)));
  EXPECT_TRUE(run.line.resume(report_of(0, 1e6)));
  EXPECT_EQ(run.line.now(), 100'000'001);
}

TYPED_TEST(TimeLineTest, NewSessionRestartsAndDiscardsOldOne) {
  const double h = 1.0 / 64;
  LineRun<TypeParam> run(h, 40);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Random random(seed);
    const auto events = random_events(random, 2, 50, seed % 2 == 0 ? 0.0 : 0.01, 0.02);
    const double end = events.back().t + 0.01;
    const auto reports = reports_at(event_and_heartbeat_times(events, 0.01, end), events, 2,
                                    static_cast<std::int64_t>(seed));
    run.settled = {};
    run.seen.clear();
    run.line.restart(reports.front());
    run.to(far_ahead);
    // Every other session is replaced before its end.
    const std::size_t received = seed % 2 == 1 ? reports.size() / 2 : reports.size();
    for (std::size_t i = 1; i < received; ++i) {
      run.line.receive(reports[i]);
      run.to(far_ahead);
    }
    EXPECT_EQ(run.seen.front(), 0);
    EXPECT_EQ(difference(this->reference(h, events, reports[received - 1].horizon), run.settled),
              "")
        << "session " << seed;
  }
}

// More events than the time line keeps: old ones are dropped during the run.
TEST(TimeLine, DroppingOldEventsDoesNotChangeResult) {
  if (sanitized) GTEST_SKIP() << "slow";
  Random random(9);
  const double h = 1.0 / 16;
  const auto events = random_events(random, 2, 70000, 0.0, h / 64);
  const double end = events.back().t;
  std::vector<double> times;
  for (double t = 0.0; t < end; t += h / 2) times.push_back(t);
  times.push_back(end);
  const auto reports = reports_at(times, events, 2);
  ReplicaLine run(h, 20);
  run.line.restart(reports.front());
  std::size_t most = 0;
  for (const ContactMessage& report : reports) {
    run.line.receive(report);
    run.to(far_ahead);
    most = std::max(most, run.line.events().events().size());
  }
  EXPECT_LE(most, 1U << 16U);
  EXPECT_EQ(run.line.events().counts().events, static_cast<std::int64_t>(events.size()));
  EXPECT_EQ(
      difference(offline<ReplicaEstimator>(
                     two_contacts(), cached_scene("paper_beam.toml").prior.start, h, events, end),
                 run.settled),
      "");
}

}  // namespace
}  // namespace sprag
