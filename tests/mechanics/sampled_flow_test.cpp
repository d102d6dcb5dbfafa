// Flows, event search and replica with sampled inputs, on random machines of every structure.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/polynomial_response.h"
#include "sprag/detail/replica/replica.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

SampledInputPointer random_input(Random& random, double end, bool spline, bool even = true) {
  std::vector<double> t, a;
  const double dt = 0.01;
  for (double s = 0.0; s < end; s += even ? dt : random.uniform(0.3 * dt, 1.7 * dt)) {
    t.push_back(even ? dt * static_cast<double>(t.size()) : s);
    a.push_back(4.0 * std::sin(5.0 * s) + random.uniform(-1.0, 1.0));
  }
  return std::make_shared<const SampledInput>(
      t, a,
      SampledInput::Settings{
          .interpolation = spline ? Interpolation::spline : Interpolation::linear,
          .outside = Outside::hold});
}

Model random_shaken(Random& random, Structure structure, Eigen::Index f, int contacts) {
  Model model = random_machine(random, structure, f);
  add_forces(random, model, 1);
  add_contacts(random, model, contacts);
  const bool spline = random.chance(0.5);
  const auto input = random_input(random, 1.0, spline, random.chance(0.7));
  model.forces.push_back({random.vector(f), 0.0, {}, input});
  for (Contact& contact : model.contacts) {
    if (!random.chance(0.5)) continue;
    contact.input = input;
    contact.input_share = random.uniform(-1.0, 1.0);
  }
  // A second record with other times.
  if (random.chance(0.5)) {
    model.forces.push_back({random.vector(f), 0.0, {}, random_input(random, 0.8, !spline, false)});
  }
  return model;
}

TEST(SampledInputs, HaveARowForEveryCoordinateAndContactWithoutARecord) {
  constexpr std::uint64_t seed = 30;
  SCOPED_TRACE(seed);
  Random random(seed);
  Model model = random_machine(random, Structure::coupled, 3);
  add_contacts(random, model, 2);
  const SampledInputs inputs(model);
  EXPECT_TRUE(inputs.empty());
  EXPECT_EQ(inputs.forces().rows(), 3);
  EXPECT_EQ(inputs.motions().rows(), 2);
}

TEST(PolynomialStep, ComposesInEveryRegime) {
  constexpr std::uint64_t seed = 31;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (int i = 0; i < repetitions(2000); ++i) {
    const double tau = random.log_uniform(1e-4, 1.0);
    const double delta = random.chance(0.3) ? 0.0 : random.log_uniform(1e-6, 30.0) / tau;
    const double kappa = random.chance(0.2) ? 0.0 : random.log_uniform(1e-8, 1e3) / (tau * tau);
    PolynomialForce F{};
    for (std::size_t n = 0; n < F.size(); ++n) F[n] = random.uniform(-1, 1) / std::pow(tau, n);
    const double z0 = random.uniform(-1, 1) * tau * tau;
    const double v0 = random.uniform(-1, 1) * tau;
    // In 16 short steps of the closed form.
    long double z = z0;
    long double v = v0;
    const double part = tau / 16;
    for (int k = 0; k < 16; ++k) {
      PolynomialForce here{};
      for (std::size_t n = 0; n < F.size(); ++n) {
        double term = 1.0;
        for (std::size_t j = n; j < F.size(); ++j) {
          here[n] += F[j] * term;
          term *= k * part / static_cast<double>(j - n + 1);
        }
      }
      polynomial_step(delta, kappa, part).apply(here, z, v);
    }
    long double z_once = z0;
    long double v_once = v0;
    polynomial_step(delta, kappa, tau).apply(F, z_once, v_once);
    double z_fast = z0;
    double v_fast = v0;
    move_under_force(delta, kappa, F, tau, z_fast, v_fast);
    // Terms of z are of the size of tau^2, or of the static rest position.
    const double size = tau * tau;
    ASSERT_NEAR(static_cast<double>(z_once - z), 0.0, 2e-14 * size) << delta << ' ' << kappa;
    ASSERT_NEAR(z_fast - static_cast<double>(z), 0.0, 2e-14 * size) << delta << ' ' << kappa;
    ASSERT_NEAR(v_fast - static_cast<double>(v), 0.0,
                1e-13 * tau * std::max(1.0, std::sqrt(kappa) * tau))
        << delta << ' ' << kappa;
  }
}

// Residual of M u' + C u + K q = W lambda + f(t), with u' from a difference.
TEST(SampledFlow, ObeysTheEquationOfMotionWithAnyContactsLocked) {
  constexpr std::uint64_t seed = 32;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (int i = 0; i < repetitions(40); ++i) {
    for (const Structure structure : structures) {
      const auto f = static_cast<Eigen::Index>(random.integer(1, 5));
      const int m = random.integer(1, static_cast<int>(f));
      const Flows flows(random_shaken(random, structure, f, m));
      const Model& model = flows.dynamics().model();
      const ContactSet locked = static_cast<ContactSet>(random.integer(0, (1 << m) - 1));
      const Flow* flow = flows.find(locked);
      if (flow == nullptr) continue;
      Motion motion, before, after, here;
      State x = random_state(random, model);
      const double t0 = random.uniform(0.0, 0.5);
      flow->enter_closed(x.q, x.u, at(t0), motion);
      constexpr double h = 1e-5;
      // Away from knots, where u' is smooth.
      const SampledInputs& inputs = flows.dynamics().inputs();
      double t = 0.0;
      do {
        t = random.uniform(t0, 1.2);
      } while (inputs.interval(t - 2 * h) != inputs.interval(t + 2 * h));
      flow->propagate(motion, at(t), here);
      flow->propagate(motion, at(t - h), before);
      flow->propagate(motion, at(t + h), after);
      Eigen::VectorXd q(f), u(f), q_a(f), u_a(f), q_b(f), u_b(f);
      flow->state(here, q, u);
      flow->state(before, q_b, u_b);
      flow->state(after, q_a, u_a);
      Eigen::VectorXd force = -model.C * u - model.K * q;
      for (const Force& one : model.forces) {
        force += one.direction *
                 (one.constant + value(one.harmonic, t) + (one.input ? one.input->value(t) : 0.0));
      }
      for (int j = 0; j < m; ++j) {
        const Contact& contact = model.contacts[static_cast<std::size_t>(j)];
        if (contains(locked, j)) {
          force += value(flow->force(j), here) * contact.w;
          EXPECT_NEAR(gap(contact, q, t), 0.0, 1e-10);
          EXPECT_NEAR(gap_velocity(contact, u, t), 0.0, 1e-9);
          const double difference =
              (value(flow->force(j), after) - value(flow->force(j), before)) / (2 * h);
          EXPECT_NEAR(rate(flow->force(j), here), difference, 1e-3 * (1.0 + std::abs(difference)));
        } else {
          EXPECT_NEAR(value(flow->gap(j), here), gap(contact, q, t), 1e-11);
          EXPECT_NEAR(value(flow->gap_velocity(j), here), gap_velocity(contact, u, t), 1e-10);
          EXPECT_NEAR(rate(flow->gap(j), here), gap_velocity(contact, u, t), 1e-10);
          const double difference =
              (value(flow->gap_velocity(j), after) - value(flow->gap_velocity(j), before)) /
              (2 * h);
          EXPECT_NEAR(rate(flow->gap_velocity(j), here), difference,
                      1e-4 * (1.0 + std::abs(difference)));
          EXPECT_NEAR(second_rate(flow->gap(j), here), difference,
                      1e-4 * (1.0 + std::abs(difference)));
        }
      }
      const Eigen::VectorXd inertia = model.M * (u_a - u_b) / (2 * h);
      EXPECT_LE((inertia - force).norm(), 1e-4 * (1.0 + force.norm()))
          << structure_names[static_cast<std::size_t>(structure)] << " locked " << locked;
      EXPECT_LE(((q_a - q_b) / (2 * h) - u).norm(), 1e-4 * (1.0 + u.norm()));
      if (testing::Test::HasFailure()) return;
    }
  }
}

TEST(SampledFlow, OneStepThroughManyKnotsEqualsManySteps) {
  constexpr std::uint64_t seed = 33;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (const Structure structure : structures) {
    const Eigen::Index f = 3;
    const Flows flows(random_shaken(random, structure, f, 1));
    const Flow& flow = flows[0];
    const State x = random_state(random, flows.dynamics().model());
    Motion motion, steps;
    flow.enter(x.q, x.u, at(0.0), Eigen::VectorXd(0), motion);
    steps = motion;
    for (int k = 1; k <= 997; ++k) flow.propagate(steps, at(k * 1e-3), steps);
    flow.propagate(motion, at(0.997), motion);
    Eigen::VectorXd q(f), u(f), q_steps(f), u_steps(f);
    flow.state(motion, q, u);
    flow.state(steps, q_steps, u_steps);
    EXPECT_LE((q - q_steps).norm(), 1e-12 * (1.0 + q.norm()));
    EXPECT_LE((u - u_steps).norm(), 1e-12 * (1.0 + u.norm()));
  }
}

// Between its events the master's gaps stay positive, and closed contacts push.
TEST(SampledSearch, MissesNoTouch) {
  constexpr std::uint64_t seed = 34;
  SCOPED_TRACE(seed);
  Random random(seed);
  int looked = 0;
  for (int i = 0; i < repetitions(60); ++i) {
    ImpactingMachine machine = random_impacting_machine(random);
    Model& model = machine.model;
    const auto input = random_input(random, 4.0, random.chance(0.5), random.chance(0.7));
    Eigen::VectorXd direction = random.vector(model.coordinates());
    model.forces.push_back({3.0 * direction, 0.0, {}, input});
    Master master(model, machine.start);
    std::vector<ContactEvent> events;
    Eigen::VectorXd q(model.coordinates()), u(model.coordinates());
    try {
      for (int k = 0; k <= 6000; ++k) {
        const double t = k * 5e-4;
        master.advance(at(t), events);
        master.state(at(t), q, u);
        for (const Contact& contact : model.contacts) {
          ASSERT_GE(gap(contact, q, t), -1e-9 * (1.0 + q.norm())) << "machine " << i << " t " << t;
        }
        ++looked;
      }
    } catch (const SimulationError&) {
      continue;
    }
  }
  EXPECT_GT(looked, repetitions(100000));
}

// A replica that starts in the master's state stays there, through impacts and lasting contacts.
TEST(SampledReplica, StaysOnTheMaster) {
  constexpr std::uint64_t seed = 35;
  SCOPED_TRACE(seed);
  Random random(seed);
  int events = 0;
  for (int i = 0; i < repetitions(30); ++i) {
    ImpactingMachine machine = random_impacting_machine(random);
    Scene scene;
    scene.model = machine.model;
    const auto input = random_input(random, 2.0, random.chance(0.5));
    scene.model.forces.push_back({3.0 * random.vector(scene.model.coordinates()), 0.0, {}, input});
    scene.truth.start = scene.prior.start = machine.start;
    try {
      Pair<Replica> pair(scene, 3e-3);
      const double size = 1.0 + pair.q_m.norm();
      for (int k = 0; k < 600; ++k) {
        pair.step();
        events += static_cast<int>(pair.passed.size());
        ASSERT_LE(pair.V(), 1e-14 * size) << "machine " << i << " t " << pair.t();
      }
    } catch (const SimulationError&) {
      continue;
    }
  }
  EXPECT_GT(events, sanitized ? 1 : 100);
}

}  // namespace
}  // namespace sprag::test
