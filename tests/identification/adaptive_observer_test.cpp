#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <random>

#include "sprag/detail/live/machine_adaptation.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/energy.h"
#include "sprag/observer.h"
#include "tests/support/random.h"
#include "tests/support/rattle.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::events_of;
using test::shipped_scene;

constexpr double tick_length = 0.05, observed = 24.0;  // duration of an observation

/// The paper's beam with a wrong damping and restitution.
Scene wrong_scene() {
  Scene scene = shipped_scene("paper_beam");
  scene.prior.adaptation.free = {"impact.restitution", "beam.damping"};
  scene.prior.adaptation.within.setConstant(1, 0.1);
  return with(scene, unknowns_to_adapt(scene), Eigen::Vector2d(0.67, 0.18));
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
  MachineAdaptation adaptation(estimator);
  adaptation.start(0.0, 0);
  bool wanted = false;
  Confidence confidence = estimator.no_confidence();
  std::vector<Row> rows;
  std::size_t next = 0;
  for (std::int64_t k = 0; k <= last_tick(observed, tick_length); ++k) {
    const std::size_t first = next;
    while (next < events.size() && first_tick_after(events[next].t, tick_length) <= k) ++next;
    const auto of_tick = std::span(events).subspan(first, next - first);
    if (wanted) adaptation.identify(state);
    if (k > 0) estimator.tick(of_tick, state);
    wanted = adaptation.settle(of_tick, state);
    Row row{k, Eigen::VectorXd(3), Eigen::VectorXd(3), {}, false};
    estimator.output(state, row.q, row.u);
    estimator.confidence(state, confidence);
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
  const std::vector<ContactEvent> events = events_of(machine, observed);
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
    if (i % 5 == 0) observer.at(observed + 2.0);
  }
  for (double t = events[7].t; t < observed; t += 1.7) {
    observer.set_horizon(t);
    settle();
    observer.at(std::min(t + 5.0, observed));
  }
  observer.set_horizon(observed);
  settle();
  ASSERT_EQ(settled.size(), expected.size());
  for (std::size_t k = 0; k < settled.size(); ++k) ASSERT_EQ(settled[k], expected[k]) << k;

  // The estimate has converged to the machine and gives its parameters.
  const Estimate now = observer.at(observed + 1.0);
  Master master(machine.model, machine.truth.start);
  std::vector<ContactEvent> passed;
  Eigen::VectorXd q(3), u(3);
  master.advance(at(observed), passed);
  master.state(at(observed), q, u);
  EXPECT_LT(ErrorEnergy(machine.model)(q, u, settled.back().q, settled.back().u)[0], 1e-18);
  ASSERT_TRUE(now.parameters.any());
  EXPECT_EQ(*now.parameters.keys, (std::vector<std::string>{"impact.restitution", "beam.damping"}));
  EXPECT_NEAR(now.parameters.values[0], 0.7, 1e-9);
  EXPECT_NEAR(now.parameters.values[1], 0.17, 1e-9);
  EXPECT_GT(now.parameters.accepted, 10.0);
}

TEST(AdaptiveObserver, ObservesARecording) {
  const Scene scene = wrong_scene();
  const std::vector<ContactEvent> events = events_of(shipped_scene("paper_beam"), observed);
  const Estimates all =
      observe(Observer(scene, {tick_length, EstimatorKind::adaptive}), events, observed);
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

// A machine under the record of a sweep, observed from a wrong restitution and stiffness. The
// record of the observer has noise if `noise` > 0.
struct Swept {
  Scene machine, given;
};

Swept swept(Random& random, Eigen::Index f, double noise) {
  Swept swept{test::rattle(random, f), {}};
  std::vector<double> t, a, errors;
  std::mt19937_64 engine(9);
  std::normal_distribution<double> normal;
  for (int k = 0; k <= 6100; ++k) {
    t.push_back(0.005 * k);
    a.push_back(3.0 * std::sin(t.back() * (5.0 + 0.1 * t.back())) + std::sin(13.0 * t.back()));
    errors.push_back(noise * normal(engine));
  }
  const SampledInput record(t, a, {.interpolation = Interpolation::spline, .noise = noise});
  swept.machine.model.forces.push_back(
      {test::across(f), 0.0, {}, std::make_shared<const SampledInput>(record)});
  swept.machine.prior.adaptation.free = {"impact.restitution", "system.K"};
  swept.machine.prior.adaptation.within.setConstant(1, 0.1);
  swept.machine.prior.jitter = 1e-5;
  swept.given = with(swept.machine, unknowns_to_adapt(swept.machine), Eigen::Vector2d(0.67, 1.04));
  swept.given.model.forces[0].input =
      std::make_shared<const SampledInput>(with_errors(record, errors));
  return swept;
}

class AdaptiveUnderARecord : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Noise, AdaptiveUnderARecord, testing::Values(0.0, 0.02));

TEST_P(AdaptiveUnderARecord, EndsHonestFromWrongParameters) {
  constexpr std::uint64_t seed = 77;
  constexpr double end = 30.0, h = 0.01;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  double squares = 0.0, of_parameters = 0.0;
  long count = 0, values = 0;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Index f = 1 + i % 2;
    const Swept trial = swept(random, f, GetParam());
    std::vector<ContactEvent> events = events_of(trial.machine, end);
    for (ContactEvent& event : events) event.t += 1e-5 * normal(engine);
    std::stable_sort(events.begin(), events.end(),
                     [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
    const Estimates all = observe(Observer(trial.given, {h, EstimatorKind::adaptive}), events, end);
    Master master(trial.machine.model, trial.machine.truth.start);
    std::vector<ContactEvent> passed;
    Eigen::VectorXd q(f), u(f);
    const Eigen::Index last = all.t.size() - 1;
    for (Eigen::Index k = 0; k <= last; ++k) {
      master.advance(at(all.t[k]), passed);
      master.state(at(all.t[k]), q, u);
      for (Eigen::Index j = 0; j < f; ++j) {
        for (const auto& [error, sigma] : {std::pair(all.q(k, j) - q[j], all.sigma_q(k, j)),
                                           std::pair(all.u(k, j) - u[j], all.sigma_u(k, j))}) {
          if (!std::isfinite(sigma)) continue;
          squares += error * error / (sigma * sigma);
          ++count;
        }
      }
    }
    const Eigen::Vector2d truth(0.7, 1.0);
    ASSERT_TRUE(all.of_filter[static_cast<std::size_t>(last)]) << i;
    // The filter's unit of system.K is that of the given machine.
    for (int k = 0; k < 2; ++k) {
      const double value = all.parameters(last, k) * (k == 1 ? 1.04 : 1.0);
      const double sigma = all.sigma_parameters(last, k);
      std::cout << all.keys[static_cast<std::size_t>(k)] << ' ' << value << " +- " << sigma << '\n';
      EXPECT_LT(std::abs(value - truth[k]), 5.0 * sigma);
      EXPECT_LT(sigma, 0.01);
      of_parameters += std::pow((value - truth[k]) / sigma, 2);
      ++values;
    }
  }
  std::cout << "NEES " << squares / static_cast<double>(count) << " of " << count << ", parameters "
            << of_parameters / static_cast<double>(values) << '\n';
  EXPECT_GT(count, 10000);
  EXPECT_LT(squares, 1.6 * static_cast<double>(count));
  EXPECT_GT(squares, 0.1 * static_cast<double>(count));
}

TEST(AdaptiveObserver, RefusesUnsupportedScenes) {
  EXPECT_THROW(Observer(shipped_scene("paper_beam"), {0.0, EstimatorKind::adaptive}),
               std::invalid_argument);
}

}  // namespace
}  // namespace sprag
