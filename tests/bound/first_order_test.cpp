// The first-order set: it contains its elements, and it is much smaller than b alone. Both bounds
// hold. Also the expansion by joint impacts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/first_order_bound.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/master.h"
#include "tests/bound/bound_trial.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

// x of a difference of states.
Eigen::VectorXd in_energy(const EnergyMetric& metric, const Eigen::VectorXd& q,
                          const Eigen::VectorXd& u) {
  ModalState state;
  metric.enter(q, u, state);
  Eigen::VectorXd x(2 * q.size());
  x << metric.omega().cwiseProduct(state.z), state.v;
  return x / std::sqrt(2.0);
}

// Segments added during the run, each represented by one of its ends, moved by the same flights and
// impacts as the ellipsoid.
TEST(ErrorEllipsoid, ContainsEveryCombinationOfSegmentEnds) {
  constexpr std::uint64_t seed = 5220;
  std::cout << "seed " << seed << '\n';
  double closest = 0.0;
  for (int number = 0; number < 30; ++number) {
    Random random(seed + static_cast<std::uint64_t>(number));
    const Structure structure = number % 2 == 0 ? Structure::coupled : Structure::rayleigh;
    Model model = random_machine(random, structure, random.integer(1, 5));
    add_contacts(random, model, 1);
    for (Contact& contact : model.contacts) contact.motion = {};
    const Flows flows(model);
    const Dynamics& dynamics = flows.dynamics();
    const EnergyMetric metric(dynamics);
    ErrorEllipsoid ellipsoid(metric, flows[0]);
    const Eigen::Index f = model.coordinates();
    constexpr int choices = 64;
    Eigen::MatrixXd q = Eigen::MatrixXd::Zero(f, choices);
    Eigen::MatrixXd u = q;
    Motion motion;
    const Eigen::VectorXd none;
    for (int event = 0; event < 6; ++event) {
      const double tau = random.uniform(0.0, 1.0);
      const double epsilon = random.uniform(0.0, 1.0);
      const Eigen::VectorXd dq = random.vector(f), du = random.vector(f);
      ellipsoid.fly(tau);
      ellipsoid.impact(0, epsilon);
      ellipsoid.add(in_energy(metric, dq, du));
      for (int choice = 0; choice < choices; ++choice) {
        // The difference of two motions under the same forces.
        Eigen::VectorXd moved_q(f), moved_u(f), still_q(f), still_u(f);
        flows[0].enter(q.col(choice), u.col(choice), at(0.0), none, motion);
        flows[0].propagate(motion, at(tau), motion);
        flows[0].state(motion, moved_q, moved_u);
        flows[0].enter(0.0 * dq, 0.0 * du, at(0.0), none, motion);
        flows[0].propagate(motion, at(tau), motion);
        flows[0].state(motion, still_q, still_u);
        q.col(choice) = moved_q - still_q;
        u.col(choice) = moved_u - still_u;
        const double gamma = model.contacts[0].w.dot(u.col(choice));
        u.col(choice) -= (1.0 + epsilon) * gamma / dynamics.G()(0, 0) * dynamics.MinvW().col(0);
        const double sign = random.chance(0.5) ? 1.0 : -1.0;
        q.col(choice) += sign * dq;
        u.col(choice) += sign * du;
      }
    }
    ellipsoid.update_radius();
    for (int choice = 0; choice < choices; ++choice) {
      const double size = in_energy(metric, q.col(choice), u.col(choice)).norm();
      EXPECT_LE(size, ellipsoid.radius());
      EXPECT_LE(std::abs(model.contacts[0].w.dot(u.col(choice))),
                ellipsoid.largest_gap_velocity(0) * (1.0 + 1e-9));
      closest = std::max(closest, size / ellipsoid.radius());
    }
  }
  std::cout << "largest share of the radius " << closest << '\n';
  EXPECT_GT(closest, 0.7);
}

// sqrt of the median B in the second half of a run with late reports, with and without the set.
struct Floors {
  double with = 0.0, without = 0.0, worst = 0.0;
};

Floors floors_of(const std::string& name, const Tolerance& tolerance, double end) {
  BoundCase machine;
  machine.scene = shipped_scene(name);
  machine.scene.prior.tolerance = tolerance;
  machine.scene.prior.uncertainty =
      Eigen::VectorXd::Constant(machine.scene.model.coordinates(), 1e-12);
  machine.scene.prior.start = machine.start = machine.scene.truth.start;
  machine.truth = machine.scene.model;
  machine.truth.K *= 1.0 + tolerance.stiffness;
  machine.truth.C *= 1.0 - tolerance.damping;
  machine.truth.contacts[0].restitution += tolerance.restitution;
  machine.end = end;
  Master master(machine.truth, machine.start);
  master.advance(at(end), machine.events);
  const std::vector<double> shifts(machine.events.size(), tolerance.time * (1.0 - 1e-9));
  const BoundRun with = run_bound_case(machine, shifts);
  const BoundRun without = run_bound_case(machine, shifts, {.factors = {}, .first_order = false});
  EXPECT_LE(without.worst, 1.0);
  return {std::sqrt(with.median_B), std::sqrt(without.median_B), with.worst};
}

TEST(FirstOrderBound, IsSmallerThanZeroOrderBound) {
  const auto expect_share = [](const char* name, const Tolerance& tolerance, double share) {
    const Floors floors = floors_of(name, tolerance, 60.0);
    std::cout << name << ": " << floors.with << " of " << floors.without << '\n';
    EXPECT_LE(floors.worst, 1.0);
    EXPECT_GT(floors.with, 0.0);
    EXPECT_LT(floors.with, share * floors.without) << name;
  };
  expect_share("paper_beam", {.time = 1e-5}, 0.4);
  expect_share("paper_beam", {.restitution = 1e-2}, 0.4);
  expect_share("paper_beam", {.stiffness = 1e-4}, 0.2);
  expect_share("paper_beam", {.damping = 1e-3}, 0.4);
  expect_share("lab_rig", {.time = 1e-6}, 0.4);
}

TEST(JointExpansion, BoundsPairsOfStates) {
  constexpr std::uint64_t seed = 5221;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double closest = 0.0;
  for (int number = 0; number < 300; ++number) {
    const int m = random.integer(2, 4);
    const Eigen::MatrixXd w = [&] {
      Eigen::MatrixXd all(6, m);
      for (int i = 0; i < m; ++i) all.col(i) = random.vector(6) * random.log_uniform(0.1, 10.0);
      return all;
    }();
    const Eigen::MatrixXd G = w.transpose() * w;
    ContactVector epsilon(m);
    for (int i = 0; i < m; ++i) epsilon[i] = random.uniform(0.0, 1.0);
    const double factor = joint_expansion(G, bit(m) - 1, epsilon.maxCoeff());
    const ImpactLaw law = random.chance(0.5) ? ImpactLaw::newton : ImpactLaw::poisson;
    const auto struck = [&](const Eigen::VectorXd& u) {
      ContactVector Lambda, after;
      const ContactVector gamma = w.transpose() * u;
      EXPECT_EQ(impact(law, of_contacts(G, bit(m) - 1), epsilon, gamma, Lambda, after),
                Solved::yes);
      return Eigen::VectorXd(u + w * Lambda);
    };
    for (int pair = 0; pair < 50; ++pair) {
      const Eigen::VectorXd u = random.vector(6);
      const Eigen::VectorXd apart = random.vector(6) * random.log_uniform(1e-3, 1.0);
      const double expanded = (struck(u + apart) - struck(u)).norm() / apart.norm();
      EXPECT_LE(expanded, factor * (1.0 + 1e-9));
      closest = std::max(closest, expanded / factor);
    }
  }
  std::cout << "largest share " << closest << '\n';
  EXPECT_GT(closest, 0.9);
}

// Without an uncertainty of the start the forces limit the machine's motion.
TEST(NoUncertainty, BoundIsFiniteForPositiveDefiniteKAndC) {
  Scene scene = shipped_scene("paper_beam");
  scene.prior.uncertainty.resize(0);
  scene.prior.tolerance.time = 1e-5;
  EXPECT_EQ(why_no_bound(scene), "");
  Flows flows(scene.model);
  BoundTracker tracker(scene, flows, 0.01);
  EventHistory history(1, 100000);
  history.restart(0, 0, no_horizon);
  const std::vector<ContactEvent> events = events_of(scene, 100.0);
  for (const ContactEvent& event : events) history.add(event);
  history.set_horizon(101.0);
  Pair<Replica> pair(scene, 0.01);
  double first = 0.0, last = 0.0;
  while (pair.t() < 99.0) {
    pair.step();
    tracker.follow(history, pair.t());
    last = tracker.bound(history, pair.t(), pair.q_s, pair.u_s);
    ASSERT_TRUE(std::isfinite(last)) << pair.t();
    ASSERT_LE(pair.V(), last) << pair.t();
    if (first == 0.0) first = last;
  }
  std::cout << "B at first " << first << ", at the end " << last << '\n';
  EXPECT_LT(last, 1e-2 * first);
  scene.model.K.setZero();
  EXPECT_NE(why_no_bound(scene), "");
}

}  // namespace
}  // namespace sprag::test
