// Would catch impacts that differ from the master's, are recorded twice, or have a wrong sigma.
#include "sprag/detail/estimates/impact_record.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "sprag/detail/live/drive.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "tests/support/jitter.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

// Data of each event by the exact master, from its states on both sides and its locked flow.
struct TrueImpact {
  ContactEvent event;
  double before = 0.0, after = 0.0, impulse = 0.0;
  double begin = 0.0, end = 0.0, largest = 0.0, force_impulse = 0.0;
};

std::vector<TrueImpact> true_impacts(const Scene& scene, double end) {
  const std::vector<ContactEvent> events = master_events(scene, end);
  Master master(scene.model, scene.truth.start);
  const Eigen::Index f = scene.model.coordinates();
  const Dynamics dynamics(scene.model);
  Eigen::VectorXd q(f), u(f), q_after(f), u_after(f);
  std::vector<ContactEvent> ignored;
  std::vector<TrueImpact> truth;
  std::vector<double> closed_at(scene.model.contacts.size(), -1.0);
  std::vector<TrueImpact> held(scene.model.contacts.size());
  double now = 0.0;
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    const double t = of_one.front().t;
    // Forces since the previous instant.
    const ContactSet closed = master.closed();
    const Flow* flow = closed != 0 ? master.flows().find(closed) : nullptr;
    const int samples = 400;
    for (int k = 0; flow != nullptr && k <= samples; ++k) {
      const double at_time = now + (t - now) * k / samples;
      const Instant instant = at(k == samples ? std::nextafter(t, 0.0) : at_time);
      master.advance(instant, ignored);
      master.state(instant, q, u);
      Motion motion;
      flow->enter(q, u, instant, Eigen::VectorXd::Zero(std::popcount(closed)), motion);
      for_each(closed, [&](int i) {
        TrueImpact& of = held[static_cast<std::size_t>(i)];
        const double lambda = value(flow->force(i), motion);
        if (k == 0 && closed_at[static_cast<std::size_t>(i)] == now) {
          of.begin = of.largest = lambda;
          of.force_impulse = 0.0;
        }
        of.end = lambda;
        of.largest = std::max(of.largest, lambda);
        const double weight = k == 0 || k == samples ? 1.0 : k % 2 == 1 ? 4.0 : 2.0;
        of.force_impulse += weight * lambda * (t - now) / (3.0 * samples);
      });
    }
    if (t > 0.0) {
      master.advance(at(std::nextafter(t, 0.0)), ignored);
      master.state(at(std::nextafter(t, 0.0)), q, u);
    } else {
      q = scene.truth.start.q;
      u = scene.truth.start.u;
    }
    master.advance(at(t), ignored);
    master.state(at(t), q_after, u_after);
    for (const ContactEvent& event : of_one) {
      const Contact& contact = scene.model.contacts[static_cast<std::size_t>(event.contact)];
      TrueImpact impact;
      if (event.kind == ContactEventKind::opens) {
        impact = held[static_cast<std::size_t>(event.contact)];
      }
      impact.event = event;
      impact.before = gap_velocity(contact, u, t);
      impact.after = gap_velocity(contact, u_after, t);
      // An impact of a single contact: M (u+ - u-) = w Lambda.
      const Eigen::VectorXd momentum = scene.model.M * (u_after - u);
      impact.impulse = contact.w.dot(momentum) / contact.w.squaredNorm();
      if (event.kind == ContactEventKind::closes) {
        closed_at[static_cast<std::size_t>(event.contact)] = t;
      }
      truth.push_back(impact);
    }
    now = t;
  });
  return truth;
}

template <typename E>
std::vector<ImpactRecord> records_of(E& estimator, const Scene& scene,
                                     std::span<const ContactEvent> events, double end) {
  std::vector<ImpactRecord> records;
  estimator.record_in(records);
  typename E::State state;
  estimator.start(scene.prior.start, 0, 0, state);
  const double h = estimator.h();
  for (std::int64_t k = 1; tick_instant(k, h).hi <= end; ++k) {
    std::size_t n = 0;
    while (n < events.size() && first_tick_after(events[n].t, h) <= k) ++n;
    estimator.tick(events.first(n), state);
    events = events.subspan(n);
  }
  return records;
}

void expect_near(double value, double truth, double scale, const char* what, double t) {
  EXPECT_NEAR(value, truth, 1e-7 * scale) << what << " at t = " << t;
}

class ImpactsOfExactEvents : public testing::TestWithParam<const char*> {};

// After the filter has converged its rows equal the master's own impacts and forces.
TEST_P(ImpactsOfExactEvents, EqualMasterImpacts) {
  Scene scene = cached_scene(GetParam());
  const double end = 12.0;
  const std::vector<TrueImpact> truth = true_impacts(scene, end);
  for (const EstimatorKind kind : {EstimatorKind::timing, EstimatorKind::both}) {
    TrackingEstimator estimator(scene, 0.01, kind);
    std::vector<ContactEvent> events;
    for (const TrueImpact& of : truth) events.push_back(of.event);
    const std::vector<ImpactRecord> records = records_of(estimator, scene, events, end + 0.02);
    ASSERT_EQ(records.size(), truth.size());
    double speed = 0.0, force = 0.0;
    for (const TrueImpact& of : truth) {
      speed = std::max(speed, std::abs(of.before));
      force = std::max(force, std::abs(of.largest));
    }
    int compared = 0, sustained = 0;
    for (std::size_t i = truth.size() / 2; i < truth.size(); ++i) {
      const TrueImpact& of = truth[i];
      const ImpactRecord& record = records[i];
      ASSERT_EQ(record.t, of.event.t);
      ASSERT_EQ(record.contact, of.event.contact);
      ASSERT_EQ(record.kind, of.event.kind);
      if (!record.from_filter) continue;
      ++compared;
      expect_near(record.before.value, of.before, speed, "before", record.t);
      expect_near(record.after.value, of.after, speed, "after", record.t);
      EXPECT_LT(record.before.sigma, 1e-6 * speed);
      if (record.kind != ContactEventKind::opens) {
        expect_near(record.impulse.value, of.impulse, speed, "impulse", record.t);
        EXPECT_FALSE(record.sustained);
        continue;
      }
      if (!record.sustained) continue;
      ++sustained;
      expect_near(record.force_begin.value, of.begin, force, "begin", record.t);
      expect_near(record.force_end.value, of.end, force, "end", record.t);
      EXPECT_NEAR(record.force_largest.value, of.largest, 1e-4 * force);
      expect_near(record.force_impulse.value, of.force_impulse, force, "impulse", record.t);
      EXPECT_LT(record.force_impulse.sigma, 1e-6 * force);
    }
    EXPECT_GT(compared, 3);
    std::cout << GetParam() << ": " << compared << " rows, " << sustained << " releases\n";
  }
}
INSTANTIATE_TEST_SUITE_P(Machines, ImpactsOfExactEvents,
                         testing::Values("paper_beam.toml", "paper_beam_chatter.toml",
                                         "two_stops_beam.toml", "steel_ruler.toml",
                                         "impact_oscillator.toml", "non_proportional.toml"));

TEST(ImpactRecord, ReplicaHasNoSigmaAndConvergesToMasterForces) {
  const Scene& scene = cached_scene("two_stops_beam.toml");
  const double end = 60.0;
  const std::vector<TrueImpact> truth = true_impacts(scene, end);
  std::vector<ContactEvent> events;
  for (const TrueImpact& of : truth) events.push_back(of.event);
  TrackingEstimator estimator(scene, 0.01, EstimatorKind::replica);
  const auto records = records_of(estimator, scene, events, end + 0.02);
  ASSERT_EQ(records.size(), truth.size());
  int sustained = 0;
  double early = 0.0, late = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const ImpactRecord& record = records[i];
    EXPECT_FALSE(record.from_filter);
    EXPECT_TRUE(std::isinf(record.before.sigma) && std::isinf(record.impulse.sigma));
    double& off = i < truth.size() / 2 ? early : late;
    off = std::max(off, std::abs(record.impulse.value - truth[i].impulse));
    if (!record.sustained || i < truth.size() * 3 / 4) continue;
    ++sustained;
    EXPECT_TRUE(std::isinf(record.force_impulse.sigma));
    EXPECT_NEAR(record.force_impulse.value, truth[i].force_impulse,
                0.2 * std::abs(truth[i].force_impulse));
  }
  EXPECT_GT(sustained, 0);
  EXPECT_LT(late, 0.1 * early);
}

// Each event at the start makes the time line start again.
TEST(ImpactRecord, EventsAtTheStartAreRecordedOnce) {
  using enum ContactEventKind;
  const std::vector<ContactEvent> events{{0.0, 0, closes}, {0.0, 1, closes}, {0.5, 0, opens}};
  const Scene& scene = cached_scene("two_supports_beam.toml");
  ReplicaEstimator estimator(scene, 0.01);
  std::vector<ImpactRecord> records;
  estimator.record_in(records);
  drive(estimator, scene, events, 1.0, [](const TrackingState&) {});
  ASSERT_EQ(records.size(), events.size());
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(records[i].contact, events[i].contact);
    EXPECT_EQ(records[i].kind, events[i].kind);
  }
}

struct ImpactTrial {
  const char* scene;
  double sigma;
  double low, high;  // of NEES
};

class ImpactsOfJitteringEvents : public testing::TestWithParam<ImpactTrial> {};

// Errors against the claimed sigma, over runs with independent jitter, from starts 1e-6 apart: the
// rows of runs on one orbit share their errors, and chaotic orbits differ in their near impacts.
TEST_P(ImpactsOfJitteringEvents, AreCalibrated) {
  const ImpactTrial& of = GetParam();
  const int starts = std::max(long_repetitions(10), 3);
  constexpr int runs_each = 10;
  const double end = 15.0;
  double squares[5] = {};
  int rows = 0, releases = 0;
  std::vector<TrueImpact> truth;
  for (int run = 0; run < starts * runs_each; ++run) {
    Scene scene = cached_scene(of.scene);
    scene.prior.jitter = of.sigma;
    scene.truth.start.q[0] -=
        1e-6 * (run / runs_each) * length_scale(scene.model, scene.truth.start);
    if (run % runs_each == 0) truth = true_impacts(scene, end);
    std::vector<ContactEvent> exact;
    for (const TrueImpact& impact : truth) exact.push_back(impact.event);
    std::mt19937_64 engine(static_cast<unsigned>(run + 1));
    const auto events = test::jittered_together(exact, of.sigma, 8.0, engine);
    TrackingEstimator estimator(scene, 0.01, EstimatorKind::timing);
    const auto records = records_of(estimator, scene, events, end + 0.1);
    ASSERT_EQ(records.size(), truth.size());
    const auto add = [](double& sum, const Uncertain& x, double is) {
      sum += square((x.value - is) / x.sigma);
    };
    for (std::size_t i = truth.size() / 3; i < truth.size(); ++i) {
      const ImpactRecord& record = records[i];
      if (record.contact != truth[i].event.contact || record.kind != truth[i].event.kind) continue;
      // Impacts that cannot be distinguished determine little, and their sigma is large.
      const double apart = 8.0 * of.sigma;
      const bool alone = truth[i].event.t - truth[i - 1].event.t > apart &&
                         (i + 1 == truth.size() || truth[i + 1].event.t - truth[i].event.t > apart);
      if (record.kind == ContactEventKind::pulse && alone) {
        ++rows;
        add(squares[0], record.before, truth[i].before);
        add(squares[1], record.after, truth[i].after);
        add(squares[2], record.impulse, truth[i].impulse);
        add(squares[3], record.time, truth[i].event.t);
      } else if (record.sustained) {
        ++releases;
        add(squares[4], record.force_impulse, truth[i].force_impulse);
      }
    }
  }
  std::cout << of.scene << " " << of.sigma << ": " << rows << " rows, z^2";
  ASSERT_GT(rows, 100);
  for (int k = 0; k < 4; ++k) {
    std::cout << ' ' << squares[k] / rows;
    EXPECT_GT(squares[k] / rows, of.low);
    EXPECT_LT(squares[k] / rows, of.high);
  }
  if (releases > 0) {
    EXPECT_GT(squares[4] / releases, of.low);
    EXPECT_LT(squares[4] / releases, of.high);
    std::cout << "; " << releases << " releases " << squares[4] / releases;
  }
  std::cout << '\n';
}
INSTANTIATE_TEST_SUITE_P(Machines, ImpactsOfJitteringEvents,
                         testing::Values(ImpactTrial{"paper_beam.toml", 1e-4, 0.4, 1.4},
                                         ImpactTrial{"paper_beam.toml", 1e-2, 0.4, 1.4},
                                         ImpactTrial{"steel_ruler.toml", 1e-3, 0.4, 1.4},
                                         ImpactTrial{"two_stops_beam.toml", 1e-3, 0.4, 1.4},
                                         ImpactTrial{"impact_oscillator.toml", 1e-3, 0.4, 1.4},
                                         ImpactTrial{"paper_beam_chatter.toml", 1e-3, 0.4, 1.4}));

}  // namespace
}  // namespace sprag
