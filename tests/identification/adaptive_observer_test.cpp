#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/energy.h"
#include "sprag/master.h"
#include "sprag/observer.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::events_of;
using test::shipped_scene;

constexpr double tick_length = 0.05, duration = 24.0;

/// The paper's beam with a wrong damping and restitution.
Scene wrong_scene() {
  Scene scene = shipped_scene("paper_beam");
  scene.prior.adaptation.free = {"impact.restitution", "beam.damping"};
  scene.prior.adaptation.within.setConstant(1, 0.1);
  const MachineFamily family(scene, unknowns_to_adapt(scene));
  return family.with(Eigen::Vector2d(0.67, 0.18));
}

struct Row {
  std::int64_t tick;
  Eigen::VectorXd q, u, values;
  bool of_filter;

  bool operator==(const Row&) const = default;
};

// Events tick by tick, with immediate results of identification.
std::vector<Row> expected_rows(const Scene& scene, const std::vector<ContactEvent>& events) {
  TrackingEstimator estimator(scene, tick_length, EstimatorKind::adaptive);
  TrackingState state;
  estimator.start(scene.prior.start, 0, 0, state);
  AdaptationResult result;
  Confidence confidence = estimator.no_confidence();
  std::vector<Row> rows;
  std::size_t next = 0;
  for (std::int64_t k = 0; k <= last_tick(duration, tick_length); ++k) {
    const std::size_t first = next;
    while (next < events.size() && first_tick_after(events[next].t, tick_length) <= k) ++next;
    if (k > 0) {
      identify_now(estimator, state, result);
      estimator.tick(std::span(events).subspan(first, next - first), state);
    }
    Row row{k, Eigen::VectorXd(3), Eigen::VectorXd(3), {}, false};
    estimator.output(state, row.q, row.u);
    estimator.confidence(state, 1.0, confidence);
    row.values = confidence.parameters.values;
    row.of_filter = confidence.from_filter;
    rows.push_back(row);
  }
  return rows;
}

Row row_of(const Estimate& of) { return {of.tick, of.q, of.u, of.parameters.values, of.of_filter}; }

// Events in any order, some after the watermark, with provisional estimates in between.
TEST(AdaptiveObserver, SettlesTheTicksOfItsEstimator) {
  const Scene scene = wrong_scene(), machine = shipped_scene("paper_beam");
  const std::vector<ContactEvent> events = events_of(machine, duration);
  const std::vector<Row> expected = expected_rows(scene, events);
  ASSERT_TRUE(expected.back().of_filter);
  std::vector<ContactEvent> any_order = events;
  std::mt19937_64 engine(7);
  std::shuffle(any_order.begin() + 8, any_order.end(), engine);
  Observer observer(scene, {tick_length, EstimatorKind::adaptive});
  std::vector<Row> settled;
  for (std::size_t i = 0; i < 8; ++i) observer.take(any_order[i]);
  const auto settle = [&] {
    for (const Estimate& estimate : observer.settle()) settled.push_back(row_of(estimate));
  };
  observer.set_horizon(events[6].t);
  settle();
  observer.at(events[7].t + 3.0);
  for (std::size_t i = 8; i < events.size(); ++i) {
    observer.take(any_order[i]);
    if (i % 5 == 0) observer.at(duration + 2.0);
  }
  for (double t = events[7].t; t < duration; t += 1.7) {
    observer.set_horizon(t);
    settle();
    observer.at(std::min(t + 5.0, duration));
  }
  observer.set_horizon(duration);
  settle();
  ASSERT_EQ(settled.size(), expected.size());
  for (std::size_t k = 0; k < settled.size(); ++k) ASSERT_EQ(settled[k], expected[k]) << k;

  // The estimate has converged to the machine and gives its parameters.
  const Estimate now = observer.at(duration + 1.0);
  Master master(machine.model, machine.truth.start);
  std::vector<ContactEvent> passed;
  Eigen::VectorXd q(3), u(3);
  master.advance(at(duration), passed);
  master.state(at(duration), q, u);
  EXPECT_LT(ErrorEnergy(machine.model)(q, u, settled.back().q, settled.back().u)[0], 1e-18);
  ASSERT_TRUE(now.parameters.any());
  EXPECT_EQ(*now.parameters.keys, (std::vector<std::string>{"impact.restitution", "beam.damping"}));
  EXPECT_NEAR(now.parameters.values[0], 0.7, 1e-9);
  EXPECT_NEAR(now.parameters.values[1], 0.17, 1e-9);
  EXPECT_GT(now.parameters.accepted, 10.0);
}

TEST(AdaptiveObserver, ObservesARecording) {
  const Scene scene = wrong_scene();
  const std::vector<ContactEvent> events = events_of(shipped_scene("paper_beam"), duration);
  const Estimates all =
      observe(Observer(scene, {tick_length, EstimatorKind::adaptive}), events, duration);
  const std::vector<Row> expected = expected_rows(scene, events);
  ASSERT_EQ(all.t.size(), static_cast<Eigen::Index>(expected.size()));
  EXPECT_EQ(all.keys.size(), 2U);
  for (Eigen::Index k = 0; k < all.t.size(); ++k) {
    const Row& of = expected[static_cast<std::size_t>(k)];
    ASSERT_EQ(all.q.row(k).transpose(), of.q);
    ASSERT_EQ(all.parameters.row(k).transpose(), of.values);
    ASSERT_EQ(all.of_filter[static_cast<std::size_t>(k)] != 0, of.of_filter);
  }
  EXPECT_TRUE(std::isinf(all.sigma_parameters(0, 0)));
  EXPECT_LT(all.sigma_parameters(all.t.size() - 1, 0), 1e-6);
}

TEST(AdaptiveObserver, RefusesUnsupportedScenes) {
  EXPECT_THROW(Observer(shipped_scene("non_proportional"), {0.01, EstimatorKind::adaptive}),
               ModelError);
  EXPECT_THROW(Observer(shipped_scene("paper_beam"), {0.0, EstimatorKind::adaptive}),
               std::invalid_argument);
}

}  // namespace
}  // namespace sprag
