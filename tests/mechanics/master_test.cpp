// The master by its properties: closed forms, energy, non-penetration, symmetry.
#include "sprag/detail/mechanics/master.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/run.h"

namespace sprag::test {
namespace {

Scene ball(double height, double restitution) {
  Scene scene = shipped_scene("bouncing_ball");
  scene.truth.start.q[0] = height;
  scene.model.contacts[0].restitution = restitution;
  return scene;
}

TEST(BouncingBall, MatchesClosedFormUpToRest) {
  for (const auto& [height, restitution] : {std::pair(0.9, 0.9), std::pair(1.0, 0.7)}) {
    const std::vector<ContactEvent> events = events_of(ball(height, restitution), 100.0);
    const double first = std::sqrt(2.0 * height / 9.81);
    ASSERT_GT(events.size(), 2U);
    EXPECT_NEAR(events.front().t, first, 1e-9);
    EXPECT_EQ(events.back().kind, ContactEventKind::closes);
    EXPECT_NEAR(events.back().t, first * (1.0 + restitution) / (1.0 - restitution), 1e-9);
    double t = first;
    double flight = 2.0 * first * restitution;
    for (const ContactEvent& event : events) {
      if (event.kind != ContactEventKind::pulse) break;
      EXPECT_NEAR(event.t, t, 1e-9);
      t += flight;
      flight *= restitution;
    }
  }
}

// With a long chatter time the error of the completion is not below the tolerance of the above.
TEST(BouncingBall, ChatterIsCompletedInTheChatterTimeAtTheTimeOfRest) {
  Scene scene = ball(0.9, 0.9);
  scene.model.chatter_time = 0.1;
  const std::vector<ContactEvent> events = events_of(scene, 100.0);
  ASSERT_GT(events.size(), 2U);
  const double rest = 19.0 * std::sqrt(2.0 * 0.9 / 9.81);
  EXPECT_EQ(events.back().kind, ContactEventKind::closes);
  EXPECT_NEAR(events.back().t, rest, 1e-9);
  EXPECT_LT(rest - events[events.size() - 2].t, 0.1);
  EXPECT_GT(rest - events[events.size() - 3].t, 0.1);
}

TEST(BouncingBall, WithoutRestitutionStaysAtFirstContact) {
  const std::vector<ContactEvent> events = events_of(ball(0.9, 0.0), 100.0);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, ContactEventKind::closes);
}

// A block on two feet with a small moment of inertia: an impulse on one foot accelerates the other
// downwards.
TEST(BlockOnTwoFeet, TouchingFootTakesPartInImpactOfOther) {
  Model model;
  model.M = Eigen::Vector2d(1.0, 0.3).asDiagonal();
  model.C = model.K = Eigen::MatrixXd::Zero(2, 2);
  model.forces.push_back({Eigen::Vector2d(1.0, 0.0), 1.0, {}});
  model.contacts.push_back({Eigen::Vector2d(1.0, -1.0), 0.0, {}, 0.0});
  model.contacts.push_back({Eigen::Vector2d(1.0, 1.0), 0.0, {}, 0.0});
  Master master(model, {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(-0.5, 0.5)});
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(2);
  Eigen::VectorXd u(2);
  master.advance(at(2.0), events);
  master.state(at(2.0), q, u);
  EXPECT_LE((q - Eigen::Vector2d(2.0, 0.0)).norm(), 1e-14);
  EXPECT_LE((u - Eigen::Vector2d(2.0, 0.0)).norm(), 1e-14);
}

// A block that rocks on its two feet comes to rest on both: an impulse on one foot forces the
// release of the other, for ever shorter flights.
TEST(BlockOnTwoFeet, RocksToRest) {
  for (const double epsilon : {0.0, 0.5}) {
    Model model;
    model.M = Eigen::Vector2d(1.0, 3.0).asDiagonal();
    model.C = model.K = Eigen::MatrixXd::Zero(2, 2);
    model.forces.push_back({Eigen::Vector2d(-1.0, 0.0), 1.0, {}});
    model.contacts.push_back({Eigen::Vector2d(1.0, -1.0), 0.0, {}, epsilon});
    model.contacts.push_back({Eigen::Vector2d(1.0, 1.0), 0.0, {}, epsilon});
    Master master(model, {Eigen::Vector2d(0.1, 0.05), Eigen::Vector2d(0.0, 0.0)});
    std::vector<ContactEvent> events;
    Eigen::VectorXd q(2);
    Eigen::VectorXd u(2);
    master.advance(at(100.0), events);
    master.state(at(100.0), q, u);
    EXPECT_EQ(master.closed(), bit(0) | bit(1)) << epsilon;
    EXPECT_LE(q.norm(), 1e-10) << epsilon;
    EXPECT_LE(u.norm(), 1e-12) << epsilon;
    EXPECT_LT(events.back().t, 20.0) << epsilon;
  }
}

class Scenes : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Beams, Scenes,
                         testing::Values("paper_beam", "paper_beam_frame", "paper_beam_chatter"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST_P(Scenes, EventsDoNotDependOnAdvanceSteps) {
  const Scene scene = shipped_scene(GetParam());
  const std::vector<ContactEvent> at_once = events_of(scene, 40.0);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> in_ticks;
  for (std::int64_t k = 0; k <= 40000; ++k) master.advance(tick_instant(k, 1e-3), in_ticks);
  EXPECT_EQ(at_once, in_ticks);
}

TEST_P(Scenes, EnergyOfTheUnforcedMachineNeverGrows) {
  Scene scene = shipped_scene(GetParam());
  scene.model.forces.clear();
  scene.model.contacts[0].motion = {};
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(3);
  Eigen::VectorXd u(3);
  double before = std::numeric_limits<double>::infinity();
  double first = 0.0;
  for (std::int64_t k = 0; k <= 20000; ++k) {
    const Instant t = tick_instant(k, 1e-3);
    master.advance(t, events);
    master.state(t, q, u);
    const double energy = 0.5 * u.dot(scene.model.M * u) + 0.5 * q.dot(scene.model.K * q);
    if (k == 0) first = energy;
    ASSERT_LE(energy, before + 1e-14 * first) << "t = " << t.hi;
    before = energy;
  }
  EXPECT_GT(events.size(), 3U);
}

TEST_P(Scenes, MirroredMachineHasTheSameEvents) {
  const Scene scene = shipped_scene(GetParam());
  Scene mirrored = scene;
  mirrored.truth.start.q = -scene.truth.start.q;
  mirrored.truth.start.u = -scene.truth.start.u;
  mirrored.model.contacts[0].w = -scene.model.contacts[0].w;
  for (Force& force : mirrored.model.forces) force.direction = -force.direction;
  EXPECT_EQ(events_of(scene, 30.0), events_of(mirrored, 30.0));
}

TEST(PenetratingStart, StaysClosedUntilTheGapRisesThroughZero) {
  const Scene scene = shipped_scene("paper_beam_as_printed");
  ASSERT_TRUE(scene.truth.release_penetration);
  const Contact& contact = scene.model.contacts[0];
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(3);
  Eigen::VectorXd u(3);
  double opened = 0.0;
  for (std::int64_t k = 0; k <= 2000; ++k) {
    const Instant t = tick_instant(k, 1e-3);
    master.advance(t, events);
    master.state(t, q, u);
    const double g = gap(contact, q, t.hi);
    if (opened == 0.0 && master.closed() == 0) opened = t.hi;
    if (opened == 0.0) {
      ASSERT_LE(g, 1e-12);
      ASSERT_GE(gap_velocity(contact, u, t.hi), -1e-12);
    } else {
      ASSERT_GE(g, -1e-12);
    }
  }
  ASSERT_GE(events.size(), 2U);
  EXPECT_EQ(events[0], (ContactEvent{0.0, 0, ContactEventKind::closes}));
  EXPECT_EQ(events[1].kind, ContactEventKind::opens);
  EXPECT_GT(opened, 0.1);
}

}  // namespace
}  // namespace sprag::test
