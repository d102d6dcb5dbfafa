// Machines driven into the corners between several contacts. Time must advance, and no gap may
// become negative. Stopping one contact forces the release of another, for ever shorter flights;
// each such sequence has to be completed.
#include <gtest/gtest.h>

#include <cmath>

#include "sprag/detail/mechanics/master.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag::test {
namespace {

constexpr double horizon = 100.0;
constexpr std::size_t most_events = 200000;
constexpr double depth = 1e-10;

void run(const Model& model) {
  const Eigen::Index f = model.M.rows();
  Master master(model, {Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)});
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(f);
  Eigen::VectorXd u(f);
  for (std::int64_t k = 0; k <= 10000; ++k) {
    const Instant t = tick_instant(k, horizon / 10000);
    ASSERT_TRUE(master.advance(t, events, most_events - events.size())) << "t = " << t.hi;
    master.state(t, q, u);
    for (const Contact& contact : model.contacts) {
      ASSERT_GE(gap(contact, q, t.hi), -depth) << "t = " << t.hi;
    }
  }
  ContactSet closed = 0;
  for (const ContactEvent& event : events) {
    const bool was_closed = contains(closed, event.contact);
    ASSERT_EQ(was_closed, event.kind == ContactEventKind::opens) << "t = " << event.t;
    closed = after(closed, event);
  }
}

Eigen::VectorXd random_direction(Random& random, Eigen::Index f) {
  Eigen::VectorXd w(f);
  for (double& entry : w) entry = random.uniform(-1.5, 1.5);
  return w;
}

Eigen::MatrixXd random_diagonal(Random& random, Eigen::Index f, double low, double high) {
  Eigen::VectorXd d(f);
  for (double& entry : d) entry = random.uniform(low, high);
  return d.asDiagonal();
}

TEST(Corner, IsLeftInFiniteTime) {
  const std::uint64_t seed = 301;
  Random random(seed);
  for (int repetition = 0; repetition < repetitions(300); ++repetition) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", case " + std::to_string(repetition));
    const Eigen::Index f = random.integer(2, 4);
    Model model;
    model.M = random_diagonal(random, f, 0.5, 2.0);
    model.C = random_diagonal(random, f, 0.05, 1.0);
    model.K = random_diagonal(random, f, 0.5, 9.0);
    model.law = random.integer(0, 1) == 0 ? ImpactLaw::poisson : ImpactLaw::newton;
    for (int i = random.integer(1, 2); i > 0; --i) {
      const Harmonic time{random.uniform(0.5, 3.0), random.uniform(0.4, 3.0), 0.0};
      model.forces.push_back({random_direction(random, f), 0.0, time});
    }
    for (int i = random.integer(2, static_cast<int>(f)); i > 0; --i) {
      const double epsilon = 0.1 * random.integer(0, 9);
      model.contacts.push_back({random_direction(random, f), 0.1, {}, epsilon});
    }
    run(model);
    if (HasFatalFailure()) return;
  }
}

// Every impact of contact 2 forces the release of contact 1, for less than the rest of a chatter,
// and contact 2 rests only if contact 1 does. Both have to stay closed.
TEST(Corner, MutualForcedReleaseEndsWithBothClosed) {
  for (const auto& [first, second] : {std::pair(0.9, 0.2), std::pair(0.5, 0.5)}) {
    SCOPED_TRACE(first);
    Model model;
    model.M = model.C = Eigen::Matrix2d::Identity();
    model.K = Eigen::Vector2d(1.0, 2.0).asDiagonal();
    model.forces.push_back({Eigen::Vector2d(1.0, 0.4), 0.0, {2.0, 1.3, 0.0}});
    model.forces.push_back({Eigen::Vector2d(0.0, 1.0), 0.0, {1.0, 0.7, 0.0}});
    model.contacts.push_back({Eigen::Vector2d(1.0, 0.0), 0.1, {}, first});
    model.contacts.push_back({Eigen::Vector2d(-0.8, 0.6), 0.1, {}, second});
    Master master(model, {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()});
    std::vector<ContactEvent> events;
    EXPECT_TRUE(master.advance(at(1000.0), events, most_events));
  }
}

// Pressed against a stop, a contact without loss would bounce infinitely often; only rounding ends
// this.
TEST(Corner, LosslessBouncesBelowTimeResolutionEnd) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({-Eigen::VectorXd::Ones(1), 1.0, {}});
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, 1.0});
  Master master(model, {Eigen::VectorXd::Zero(1), -1e-15 * Eigen::VectorXd::Ones(1)});
  std::vector<ContactEvent> events;
  EXPECT_TRUE(master.advance(at(1.0), events, most_events));
  EXPECT_EQ(master.closed(), bit(0));
}

}  // namespace
}  // namespace sprag::test
