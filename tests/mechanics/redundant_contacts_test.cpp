// Closed contacts with dependent directions: an ordinary case for a replica. The motion is that of
// the machine without the redundant ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "sprag/detail/replica/replica.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

using enum ContactEventKind;
using Eigen::VectorXd;

Contact contact(const VectorXd& w, double clearance, double restitution) {
  Contact contact;
  contact.w = w;
  contact.clearance = clearance;
  contact.restitution = restitution;
  return contact;
}

struct Motions {
  std::vector<VectorXd> q, u;
  Replica::State state;
};

Motions run(const Model& model, const State& start, double h, std::int64_t ticks,
            const std::vector<ContactEvent>& events) {
  Replica replica(model, h);
  Motions motions;
  replica.start(start, 0, 0, motions.state);
  VectorXd q(model.coordinates()), u(model.coordinates());
  std::size_t from = 0;
  for (std::int64_t k = 1; k <= ticks; ++k) {
    std::size_t to = from;
    while (to < events.size() && tick_instant(k, h) - at(events[to].t) >= 0.0) ++to;
    replica.tick({events.data() + from, to - from}, motions.state);
    from = to;
    replica.output(motions.state, q, u);
    motions.q.push_back(q);
    motions.u.push_back(u);
  }
  return motions;
}

double difference(const Motions& a, const Motions& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.q.size(); ++i) {
    largest = std::max({largest, (a.q[i] - b.q[i]).cwiseAbs().maxCoeff(),
                        (a.u[i] - b.u[i]).cwiseAbs().maxCoeff()});
  }
  return largest;
}

/// A plate that heaves and tilts, pressed onto supports at -1, (0,) and 1.
Model plate(bool middle) {
  Model model;
  model.M = Eigen::Matrix2d::Identity();
  model.C = 0.2 * Eigen::Matrix2d::Identity();
  model.K = Eigen::Vector2d(2.0, 3.0).asDiagonal();
  model.forces.push_back({Eigen::Vector2d(-1.0, 0.0), 5.0, {1.0, 2.3, 0.4}});
  model.forces.push_back({Eigen::Vector2d(0.0, 1.0), 0.0, {1.5, 1.1, 0.0}});
  model.contacts.push_back(contact(Eigen::Vector2d(1.0, -1.0), 0.1, 0.4));
  model.contacts.push_back(contact(Eigen::Vector2d(1.0, 1.0), 0.1, 0.4));
  if (middle) model.contacts.push_back(contact(Eigen::Vector2d(1.0, 0.0), 0.1, 0.4));
  return model;
}

TEST(RedundantContacts, OneOfThreeSupportsIsUnloaded) {
  const State start{Eigen::Vector2d(0.3, 0.2), Eigen::Vector2d(-0.5, 1.0)};
  const std::vector<ContactEvent> two{
      {0.31, 0, closes}, {0.52, 1, closes}, {6.1, 0, opens}, {7.3, 1, opens}};
  std::vector<ContactEvent> three{two[0],          two[1], {0.7, 2, closes},
                                  {5.9, 2, opens}, two[2], two[3]};
  const Motions with = run(plate(true), start, 0.01, 1000, three);
  const Motions without = run(plate(false), start, 0.01, 1000, two);
  EXPECT_LT(difference(with, without), 1e-13);
  EXPECT_EQ(with.state.redundancy.closings, 1);
  EXPECT_EQ(with.state.redundancy.contact, 2);
  EXPECT_EQ(with.state.refused_impacts, 0);
}

// The loaded contact opens; the redundant one takes over.
TEST(RedundantContacts, TakeOverLoadOfOpeningContact) {
  Model one = plate(false);
  one.contacts.erase(one.contacts.begin() + 1);
  Model twice = one;
  twice.contacts.push_back(one.contacts[0]);
  const State start{Eigen::Vector2d(0.3, 0.2), Eigen::Vector2d(-0.5, 1.0)};
  const Motions with =
      run(twice, start, 0.01, 800,
          {{0.31, 0, closes}, {1.0, 1, closes}, {2.0, 0, opens}, {3.0, 0, pulse}, {7.0, 1, opens}});
  const Motions without = run(one, start, 0.01, 800, {{0.31, 0, closes}, {7.0, 0, opens}});
  EXPECT_LT(difference(with, without), 1e-13);
  EXPECT_EQ(with.state.refused_impacts, 0);
  EXPECT_GE(with.state.redundancy.closings, 1);
}

// Every contact of the paper's beam twice, every event twice: one impact each.
TEST(RedundantContacts, DuplicateContactActsAsOne) {
  const Scene scene = shipped_scene("paper_beam_chatter");
  Scene twice = scene;
  twice.model.contacts.push_back(scene.model.contacts[0]);
  const std::vector<ContactEvent> events = events_of(scene, 20.0);
  std::vector<ContactEvent> doubled;
  for (const ContactEvent& event : events) {
    doubled.push_back(event);
    doubled.push_back({event.t, 1, event.kind});
  }
  const Motions with = run(twice.model, scene.prior.start, 0.01, 2000, doubled);
  const Motions without = run(scene.model, scene.prior.start, 0.01, 2000, events);
  EXPECT_LT(difference(with, without), 1e-11);
  EXPECT_EQ(with.state.refused_impacts, 0);
  EXPECT_GT(with.state.redundancy.closings, 0);
}

// Between two stops that are closed at once the mass does not move, with either of them loaded.
TEST(RedundantContacts, OppositeStopsHoldAlternately) {
  Model model;
  model.M = model.K = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({VectorXd::Ones(1), 0.0, {3.0, 2.0, 0.1}});
  model.contacts.push_back(contact(VectorXd::Ones(1), 0.1, 0.5));
  model.contacts.push_back(contact(-VectorXd::Ones(1), 0.1, 0.5));
  const State start{VectorXd::Constant(1, 0.05), VectorXd::Constant(1, 0.7)};
  const Motions motions = test::run(model, start, 0.01, 1000, {{0.5, 0, closes}, {0.6, 1, closes}});
  for (std::size_t k = 61; k < motions.u.size(); ++k) {
    ASSERT_LE(std::abs(motions.u[k][0]), 1e-13) << "tick " << k + 1;
  }
  EXPECT_EQ(motions.state.redundancy.closings, 1);
  EXPECT_EQ(motions.state.refused_impacts, 0);
}

}  // namespace
}  // namespace sprag::test
