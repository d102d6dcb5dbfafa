// Would catch a restitution that does not follow its curve, an impact that brings two motions
// apart, and a wrong derivative of an impact.
#include "tests/support/by_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "sprag/detail/filter/model_flight.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/energy.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

Contact contact_with(double restitution, RestitutionCurve curve) {
  Contact contact;
  contact.w = Eigen::VectorXd::Ones(1);
  contact.restitution = restitution;
  contact.curve = std::move(curve);
  return contact;
}

TEST(RestitutionBySpeed, FollowsALineDownToZero) {
  const Contact contact = contact_with(0.8, {.slope = -0.1});
  EXPECT_DOUBLE_EQ(restitution_at(contact, -3.0).epsilon, 0.5);
  EXPECT_EQ(restitution_at(contact, -3.0).slope, -0.1);
  EXPECT_EQ(restitution_at(contact, -9.0).epsilon, 0.0);
  EXPECT_EQ(restitution_at(contact, -9.0).slope, 0.0);
  EXPECT_EQ(restitution_at(contact, 2.0).epsilon, 0.8);  // departs
  EXPECT_EQ(largest_change(contact), 0.8);
}

TEST(RestitutionBySpeed, IsLinearBetweenPointsAndConstantOutside) {
  const Contact contact = contact_with(0.45, {.at = {1.0, 2.0, 4.0}, .value = {0.9, 0.8, 0.4}});
  for (const auto& [v, epsilon] :
       {std::pair(0.0, 0.45), {1.0, 0.45}, {1.5, 0.425}, {3.0, 0.3}, {9.0, 0.2}}) {
    EXPECT_NEAR(restitution_at(contact, -v).epsilon, epsilon, 1e-15) << v;
  }
  EXPECT_NEAR(restitution_at(contact, -3.0).slope, -0.1, 1e-15);
  // epsilon v from v = 2 on: 0.4 - 0.1 (v - 2) times v, steepest at 4: 0.2 - 0.4.
  EXPECT_NEAR(largest_change(contact), 0.45, 1e-15);
  const Contact steep = contact_with(0.9, {.at = {1.0, 1.5}, .value = {0.9, 0.1}});
  EXPECT_NEAR(largest_change(steep), std::abs(0.1 - 1.6 * 1.5), 1e-12);
}

// A ball on a table: each flight lasts 2 v / g, and each impact leaves epsilon(v) v.
TEST(RestitutionBySpeed, MasterBouncesByIt) {
  Random random(5);
  for (int k = 0; k < 20; ++k) {
    Model model;
    model.M = Eigen::MatrixXd::Ones(1, 1);
    model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
    model.contacts = {contact_with(random.uniform(0.6, 0.95), {})};
    constexpr double g = 9.81, height = 0.5;
    model.forces.push_back({Eigen::VectorXd::Ones(1), -g, {}});
    double v = std::sqrt(2.0 * g * height), t = v / g;
    test::let_restitutions_fall(random, v, model);
    Master master(model, {Eigen::VectorXd::Constant(1, height), Eigen::VectorXd::Zero(1)});
    std::vector<ContactEvent> events;
    master.advance(at(3.0), events, 12);
    ASSERT_EQ(events.size(), 12U);
    for (const ContactEvent& event : events) {
      EXPECT_NEAR(event.t, t, 1e-12);
      v *= restitution_at(model.contacts[0], -v).epsilon;
      t += 2.0 * v / g;
    }
  }
}

// V falls at every impact of one contact alone, from any distance.
TEST(RestitutionBySpeed, ReplicaOfOneContactNeverDeparts) {
  constexpr std::uint64_t first_seed = 40;
  int impacts = 0;
  for (int k = 0; k < repetitions(60); ++k) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(k);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    ImpactingMachine machine = random_impacting_machine(random);
    machine.model.contacts.resize(1);
    test::let_restitutions_fall(random, random.uniform(0.5, 3.0), machine.model);
    ASSERT_LE(largest_change(machine.model.contacts[0]), 1.0);
    const Eigen::Index f = machine.model.coordinates();
    std::vector<ContactEvent> events;
    Master master(machine.model, machine.start);
    master.advance(at(4.0), events, 40);
    const ErrorEnergy energy(machine.model);
    State estimate = machine.start, now = machine.start;
    estimate.q += random.vector(f);
    estimate.u += random.vector(f);
    Master again(machine.model, machine.start);
    constexpr double h = 0.01;
    Replica replica(std::make_shared<Flows>(machine.model), h);
    ReplicaState state;
    replica.start(estimate, 0, 0, state);
    std::vector<ContactEvent> passed;
    double before = infinity;
    auto next = events.begin();
    for (std::int64_t tick = 1;
         tick <= 400 && !events.empty() && tick_instant(tick, h).hi < events.back().t; ++tick) {
      const auto first = next;
      while (next != events.end() && next->t <= tick_instant(tick, h).hi) ++next;
      replica.tick({first, next}, state);
      again.advance(tick_instant(tick, h), passed);
      again.state(tick_instant(tick, h), now.q, now.u);
      replica.output(state, estimate.q, estimate.u);
      const double V = energy(now.q, now.u, estimate.q, estimate.u)[0];
      EXPECT_LE(V, before * (1.0 + 1e-9) + 1e-18) << "tick " << tick;
      before = V;
      impacts += static_cast<int>(next - first);
    }
  }
  if (!sanitized) {
    EXPECT_GT(impacts, 5 * repetitions(60));
  }
}

// carry_through() and strike_together() against difference quotients, also while others are held.
TEST(RestitutionBySpeed, DerivativesOfImpactsMatchDifferenceQuotients) {
  constexpr std::uint64_t first_seed = 900;
  int compared = 0;
  for (int k = 0; k < repetitions(80); ++k) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(k);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    ImpactingMachine machine = random_impacting_machine(random);
    test::let_restitutions_fall(random, 3.0, machine.model);
    ModelFlight flight(std::make_shared<Flows>(machine.model));
    const Eigen::Index n = flight.n();
    Eigen::VectorXd start(2 * n), unknown(2 * n);
    flight.enter(machine.start.q, machine.start.u, 0.0, start);
    const Eigen::VectorXd dx = random.vector(2 * n);
    const bool together = flight.contacts() > 1 && k % 2 == 0;
    const ContactSet all = bit(flight.contacts()) - 1, held = together ? 0 : all & ~bit(0);
    if (!flight.can_hold(held)) continue;
    const auto struck = [&](double by, Eigen::MatrixXd& carried) {
      Eigen::VectorXd x = start + by * dx;
      flight.fly(x, 0.0, 0.0, held);
      if (!together) {
        flight.carry(carried);
        flight.strike(0, false, held);
        flight.carry_through(carried);
        return Eigen::VectorXd(flight.x());
      }
      flight.fly(x, 0.0, 0.0, 0);
      EXPECT_TRUE(flight.strike_together(all, 0, 0, 0, x, carried, unknown));
      return x;
    };
    Eigen::MatrixXd carried = dx, ignored = dx;
    struck(0.0, carried);
    if (together && !unknown.isZero(0.0)) continue;  // another branch of the law
    constexpr double step = 1e-6;
    const Eigen::VectorXd above = struck(step, ignored), below = struck(-step, ignored);
    EXPECT_LT((carried - (above - below) / (2.0 * step)).norm(), 1e-6 * (1.0 + carried.norm()));
    ++compared;
  }
  EXPECT_GT(compared, repetitions(80) / 3);
}

}  // namespace
}  // namespace sprag
