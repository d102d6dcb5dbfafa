// The cap of the distance between a machine and an admissible motion: it holds for machines with
// impacts at the limits of the tolerances, and its formulas equal independent ones.
#include "sprag/detail/bound/dissipation_cap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <vector>

#include "sprag/detail/mechanics/master.h"
#include "tests/bound/bound_trial.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

constexpr double rounding = 1.0 + 1e-9;

// W of a true machine at times on a grid.
std::vector<double> distances(const Model& truth, const State& start, const DissipationCap& cap,
                              const EnergyMetric& metric, double step, int count) {
  Master master(truth, start);
  std::vector<ContactEvent> ignored;
  Eigen::VectorXd q(truth.coordinates()), u(truth.coordinates());
  ModalState state{q, u, u};
  std::vector<double> W;
  for (int k = 0; k < count; ++k) {
    const double t = step * k;
    master.advance(at(t), ignored);
    master.state(at(t), q, u);
    metric.enter(q, u, state);
    W.push_back(cap.from_distance(0.0, state, t));
  }
  return W;
}

TEST(DissipationCap, HoldsForMachinesWithImpacts) {
  constexpr std::uint64_t seed = 5230;
  std::cout << "seed " << seed << '\n';
  double closest = 0.0;
  int caps = 0;
  for (int number = 0; number < 60; ++number) {
    Random random(seed + static_cast<std::uint64_t>(number));
    const BoundCase machine =
        random_bound_case(random, {.contacts = 1 + number % 2, .corners = random.chance(0.7)}, 30);
    const Dynamics dynamics(machine.scene.model);
    const EnergyMetric metric(dynamics);
    const DissipationCap cap(metric, machine.scene.prior.tolerance);
    // With two contacts, errors of the restitutions may gain energy.
    if (!cap.exists() || (number % 2 == 1 && machine.scene.prior.tolerance.restitution > 0.0)) {
      continue;
    }
    ++caps;
    constexpr int count = 150;
    const double step = machine.end / count;
    const std::vector<double> W = distances(machine.truth, machine.start, cap, metric, step, count);
    for (std::size_t i = 0; i < W.size(); ++i) {
      ASSERT_LE(W[i], cap.at_any_later_time(W[0]) * rounding) << number;
      for (std::size_t j = i + 1; j < W.size(); ++j) {
        const double limit = cap.advance(W[i], step * static_cast<double>(j - i));
        ASSERT_LE(W[j], limit * rounding) << number << ": from " << i << " to " << j;
        if (j > i + 3) closest = std::max(closest, W[j] / limit);
      }
    }
  }
  std::cout << caps << " machines, largest W / limit " << closest << '\n';
  EXPECT_GT(caps, 20);
  EXPECT_GT(closest, 0.9);
}

// The smallest residual force of a motion with a constant gap, computed independently (numpy, from
// the formulas of the paper): amplitudes of norm 0.795540 with the support on the ground, 2.216793
// with the support on the frame.
TEST(DissipationCap, FollowsTheForceAsFarAsTheGapAllows) {
  for (const auto& [name, force] : {std::pair{"paper_beam", 0.79553968809616626},
                                    std::pair{"paper_beam_frame", 2.2167926282761554}}) {
    const Scene scene = shipped_scene(name);
    const Dynamics dynamics(scene.model);
    const EnergyMetric metric(dynamics);
    const DissipationCap cap(metric, {});
    const double mean = cap.ultimate() * std::sqrt(2.0) * cap.rho() * std::sqrt(2.0);
    EXPECT_GE(mean, force * (1.0 - 1e-9)) << name;
    EXPECT_LE(mean, force * (1.0 + cap.rho() / 19.0)) << name;
  }
}

// The decay of uncoupled modes has a formula of its own.
TEST(DissipationCap, DecayOfUncoupledModesIsTheLimitOfCoupledOnes) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(2, 2);
  model.K = Eigen::Vector2d(1.0, 9.0).asDiagonal();
  model.C = Eigen::Vector2d(0.1, 0.2).asDiagonal();
  Model coupled = model;
  coupled.C(0, 1) = coupled.C(1, 0) = 1e-6;
  const Dynamics dynamics(model), of_coupled(coupled);
  const EnergyMetric metric(dynamics), metric_of_coupled(of_coupled);
  ASSERT_TRUE(metric.decoupled());
  ASSERT_FALSE(metric_of_coupled.decoupled());
  const double rho = slowest_decay(metric, {}).rho;
  EXPECT_GT(rho, 0.0);
  EXPECT_NEAR(rho, slowest_decay(metric_of_coupled, {}).rho, 1e-4 * rho);
}

}  // namespace
}  // namespace sprag::test
