// Observers under tolerances: the bound, its half-widths, the time when it is known, and the filter
// estimates that it refutes.
#include "sprag/detail/bound/guarantee.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/observer.h"
#include "sprag/simulate.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

Scene tolerant_beam(double time) {
  Scene scene = shipped_scene("paper_beam");
  if (scene.prior.uncertainty.size() == 0) {
    const double V0 = ErrorEnergy(scene.model)(scene.truth.start.q, scene.truth.start.u,
                                               scene.prior.start.q, scene.prior.start.u)[0];
    scene.prior.uncertainty = Eigen::VectorXd::Constant(3, V0 * 1.001 / 3.0);
  }
  scene.prior.tolerance.time = time;
  return scene;
}

std::vector<ContactEvent> moved(std::vector<ContactEvent> events, double delta, Random& random) {
  for (ContactEvent& event : events) event.t += random.chance(0.5) ? delta : -delta;
  return events;
}

TEST(Guarantee, GivesNoWidthsWithoutTolerances) {
  Scene scene = shipped_scene("paper_beam");
  ASSERT_FALSE(scene.prior.tolerance.any());
  const std::vector<ContactEvent> events = events_of(scene, 20.0);
  const Estimates exact = observe(scene, events, 20.0);
  EXPECT_EQ(exact.bound_q.cols(), 0);
  EXPECT_LT(exact.bound.maxCoeff(), infinity);
  // A negligible tolerance gives nearly the same bound.
  scene.prior.tolerance.restitution = 1e-300;
  const Estimates nearly = observe(scene, events, 20.0);
  EXPECT_EQ(nearly.bound_q.cols(), 3);
  for (Eigen::Index k = 0; k < nearly.bound.size(); ++k) {
    EXPECT_LE(nearly.bound[k], exact.bound[k] * 1.08 + 1e-20) << k;
    EXPECT_GE(nearly.bound[k], exact.bound[k] * 0.92) << k;
  }
}

// Without tolerances only the start may be uncertain.
TEST(Guarantee, InitialBoundNeedsExactMachineOrTolerances) {
  const Scene scene = shipped_scene("paper_beam");
  EXPECT_EQ(initial_bound(scene), scene.prior.uncertainty.sum());
  Scene other = scene;
  other.prior.uncertainty.resize(0);
  EXPECT_EQ(initial_bound(other), infinity);
  other = scene;
  other.prior.drift = 1e-6;
  EXPECT_EQ(initial_bound(other), infinity);
  other = scene;
  other.prior.parameters.keys = {"impact.restitution"};
  EXPECT_EQ(initial_bound(other), infinity);
  other = scene;
  other.prior.jitter = 1e-6;
  EXPECT_EQ(initial_bound(other), infinity);
  other.prior.tolerance.time = 1e-6;
  EXPECT_EQ(initial_bound(other), scene.prior.uncertainty.sum());
}

// The energy of the start's error is in the scene's stiffness, a machine's may be 1 + k_K times it,
// and B is in the scene's again.
TEST(Guarantee, TheStartCoversEveryStiffness) {
  Scene scene = shipped_scene("paper_beam");
  for (const double k_K : {1e-3, 0.02, 0.1}) {
    scene.prior.tolerance.stiffness = k_K;
    const Estimates estimates = observe(scene, {}, 0.1);
    EXPECT_NEAR(estimates.bound[0] / scene.prior.uncertainty.sum(), (1.0 + k_K) / (1.0 - k_K),
                1e-9);
  }
}

TEST(Guarantee, HoldsForObserverEstimatesAndHalfWidths) {
  constexpr std::uint64_t seed = 5210;
  std::cout << "seed " << seed << '\n';
  for (const EstimatorKind kind : {EstimatorKind::replica, EstimatorKind::both}) {
    const double delta = 1e-4;
    Scene scene = tolerant_beam(delta);
    scene.prior.jitter = delta / 2.0;
    Random random(seed);
    constexpr double end = 60.0;
    const Simulation machine = simulate(scene.model, scene.truth.start, end, 0.01);
    const Estimates all =
        observe(scene, moved(machine.events, delta * 0.999, random), end, {.estimator = kind});
    const ErrorEnergy energy(scene.model);
    int finite = 0;
    for (Eigen::Index k = 0; k < all.t.size(); ++k) {
      if (!std::isfinite(all.bound[k])) continue;
      ++finite;
      for (Eigen::Index i = 0; i < 3; ++i) {
        ASSERT_LE(std::abs(all.q(k, i) - machine.q(k, i)), all.bound_q(k, i)) << all.t[k];
      }
      const double gap_off =
          scene.model.contacts[0].w.dot((all.q.row(k) - machine.q.row(k)).transpose());
      ASSERT_LE(std::abs(gap_off), all.bound_gap(k, 0));
      if (kind == EstimatorKind::both) continue;
      const double V = energy(machine.q.row(k).transpose(), machine.u.row(k).transpose(),
                              all.q.row(k).transpose(), all.u.row(k).transpose())[0];
      ASSERT_LE(V, all.bound[k]) << all.t[k];
    }
    // Events of the last ticks may still be reported.
    EXPECT_EQ(all.t.size() - finite, 1);
    std::cout << "B at the end " << all.bound[all.t.size() - 3] << ", half-width of the gap "
              << all.bound_gap(all.t.size() - 3, 0) << '\n';
    EXPECT_LT(all.bound[all.t.size() - 3], 1e-3);
  }
}

TEST(Guarantee, HoldsUnderARecordedInput) {
  constexpr std::uint64_t seed = 5211;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  constexpr double end = 5.0;
  Scene scene = shipped_scene("swept_beam");
  const ErrorEnergy energy(scene.model);
  const double V0 =
      energy(scene.truth.start.q, scene.truth.start.u, scene.prior.start.q, scene.prior.start.u)[0];
  const Eigen::Index f = scene.model.coordinates();
  scene.prior.uncertainty = Eigen::VectorXd::Constant(f, 1.001 * V0 / static_cast<double>(f));
  const Simulation machine = simulate(scene.model, scene.truth.start, end, 0.001);
  ASSERT_GT(machine.events.size(), 100U);
  for (const double delta : {0.0, 1e-7, 1e-6}) {
    scene.prior.tolerance.time = delta;
    const Estimates all = observe(scene, moved(machine.events, 0.999 * delta, random), end,
                                  {.tick = 0.001, .estimator = EstimatorKind::replica});
    double largest = 0.0;
    for (Eigen::Index k = 0; k < all.t.size(); ++k) {
      if (!std::isfinite(all.bound[k])) continue;
      const double V = energy(machine.q.row(k).transpose(), machine.u.row(k).transpose(),
                              all.q.row(k).transpose(), all.u.row(k).transpose())[0];
      ASSERT_LE(V, all.bound[k]) << "tolerance " << delta << ", t = " << all.t[k];
      largest = std::max(largest, V / all.bound[k]);
    }
    const double last = all.bound[all.t.size() - 3];
    std::cout << "tolerance " << delta << ": V / B at most " << largest << ", B falls from " << V0
              << " to " << last << '\n';
    EXPECT_GT(largest, 0.5);
    // Chatter keeps B high: the effect of the times of its bounces is bounded by their momentum.
    EXPECT_LT(last, (delta > 0.0 ? 0.5 : 0.1) * V0);
  }
}

TEST(Guarantee, WaitsForPendingEvents) {
  const double delta = 0.05;
  const Scene scene = tolerant_beam(delta);
  Observer observer(scene, {.tick = 0.01, .estimator = EstimatorKind::replica});
  observer.set_horizon(1.0);
  const std::vector<Estimate> settled = observer.settle();
  ASSERT_FALSE(settled.empty());
  EXPECT_NEAR(settled.back().t, 1.0 - delta, 0.011);
  EXPECT_LE(settled.back().t, 1.0 - delta + 1e-12);
  for (const Estimate& estimate : settled) EXPECT_TRUE(std::isfinite(estimate.bound));
  EXPECT_EQ(observer.at(1.2).bound, infinity);
  // With an end all ticks settle, and the last ones have an infinite bound.
  observer.set_end(1.0);
  const std::vector<Estimate> rest = observer.settle();
  ASSERT_FALSE(rest.empty());
  EXPECT_EQ(rest.back().t, 1.0);
  EXPECT_EQ(rest.back().bound, infinity);
}

TEST(Guarantee, ContradictionRequiresDisjointBands) {
  const Eigen::VectorXd factors = Eigen::Vector2d(2.0, 3.0);
  const auto says = [&](double difference, double sigma, double bound) {
    return contradicts(Eigen::Vector2d(0.0, difference), Eigen::Vector2d(sigma, sigma), factors,
                       bound);
  };
  EXPECT_FALSE(says(3.0 + 0.4, 0.1, 1.0));
  EXPECT_TRUE(says(3.0 + 0.6, 0.1, 1.0));
  EXPECT_TRUE(says(-3.0 - 0.6, 0.1, 1.0));
  EXPECT_FALSE(says(100.0, 0.1, infinity));
  EXPECT_FALSE(says(100.0, infinity, 1.0));
}

// An overconfident filter is no longer shown, and its sigma is no longer claimed.
TEST(Guarantee, FallsBackToReplicaForOverconfidentFilter) {
  const Scene scene = tolerant_beam(1e-4);
  Flows flows(scene.model);
  Guarantee guarantee(scene, flows, 0.01);
  struct Line {
    EventHistory history{1, 10};
    const EventHistory& events() const { return history; }
    std::int64_t starts() const { return 1; }
    std::int64_t first_tick() const { return 0; }
    ContactSet first_closed() const { return 0; }
  } line;
  line.history.restart(0, 0, no_horizon);
  line.history.set_horizon(10.0);
  Confidence confidence;
  guarantee.prepare(confidence);
  ASSERT_EQ(confidence.bound_q.size(), 3);
  const Eigen::VectorXd q = scene.prior.start.q, u = scene.prior.start.u;
  for (const double off : {0.0, 100.0, 100.0, 0.0}) {
    confidence.from_filter = true;
    confidence.sigma_q = confidence.sigma_u = Eigen::VectorXd::Constant(3, 1e-3);
    confidence.sigma_g = confidence.sigma_outputs = Eigen::VectorXd::Constant(1, 1e-3);
    Eigen::VectorXd q_shown = q, u_shown = u;
    q_shown[0] += off;
    guarantee.follow(line, 0.0);
    guarantee.complete(line, 0.0, true, q, u, q_shown, u_shown, confidence);
    EXPECT_TRUE(std::isfinite(confidence.bound));
    EXPECT_EQ(q_shown, q);
    EXPECT_EQ(confidence.from_filter, off == 0.0);
    EXPECT_EQ(std::isfinite(confidence.sigma_q[0]), off == 0.0);
  }
  EXPECT_EQ(confidence.refutations, 1);
}

// Among all q with the energy B the largest |c^T q| is the half-width.
TEST(HalfWidths, AreAttained) {
  constexpr std::uint64_t seed = 5211;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  for (int repetition = 0; repetition < 20; ++repetition) {
    Model model = random_machine(random, Structure::coupled, random.integer(1, 5));
    add_contacts(random, model, 1);
    const Eigen::VectorXd c = random.vector(model.coordinates());
    model.outputs = {{"x", c, false}, {"v", c, true}};
    const Dynamics dynamics(model);
    const EnergyMetric metric(dynamics);
    const HalfWidths widths(metric);
    const double B = random.log_uniform(1e-6, 1.0);
    const Eigen::VectorXd q = CholeskyFactor(model.K).solve(c);
    const Eigen::VectorXd u = CholeskyFactor(model.M).solve(c);
    const double scale_q = std::sqrt(2.0 * B / q.dot(model.K * q));
    const double scale_u = std::sqrt(2.0 * B / u.dot(model.M * u));
    EXPECT_NEAR(scale_q * c.dot(q) / half_width(widths.outputs()[0], B), 1.0, 1e-6);
    EXPECT_NEAR(scale_u * c.dot(u) / half_width(widths.outputs()[1], B), 1.0, 1e-9);
  }
  EXPECT_EQ(half_width(0.0, infinity), 0.0);
  EXPECT_EQ(half_width(1.0, infinity), infinity);
}

}  // namespace
}  // namespace sprag::test
