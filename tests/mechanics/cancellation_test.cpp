// Static deflections or steady responses far larger than the motion: soft springs under weight, and
// excitation at and near resonance. Compared with 50 digits (tests/reference,
// tests/reference/reference_corners) and with series of the equation of motion.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <vector>

#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "tests/mechanics/reference_rows.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

// The ball's own machine, and the same ball on an incline, as one of the two modes of matrices that
// are not diagonal.
TEST(SoftSpring, TimeOfFallMatchesClosedForm) {
  const Eigen::Vector2d along(0.6, 0.8), across(-0.8, 0.6);
  for (const bool inclined : {false, true}) {
    double worst = 0.0;
    for (const auto& row : test::reference_rows("soft_springs")) {
      SCOPED_TRACE(testing::Message() << "K = " << row[0] << ", C = " << row[1]);
      Scene scene = test::shipped_scene("bouncing_ball");
      Model& model = scene.model;
      model.K(0, 0) = row[0];
      model.C(0, 0) = row[1];
      if (inclined) {
        model.M = Eigen::Matrix2d::Identity();
        model.K = row[0] * along * along.transpose() + 2.0 * across * across.transpose();
        model.C = row[1] * along * along.transpose() + 0.3 * across * across.transpose();
        model.forces.front().direction = model.contacts.front().w = along;
        scene.truth.start = {0.9 * along, Eigen::Vector2d::Zero()};
        ASSERT_EQ(Flow(Dynamics(model), 0).path(), FlowPath::modal);
      }
      const std::vector<ContactEvent> events = test::events_of(scene, 3.0);
      ASSERT_GE(events.size(), 3U);
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(events[i].kind, ContactEventKind::pulse);
        // Rounding relative to the other mode's K and C changes those of this mode by about 1e-16.
        EXPECT_NEAR(events[i].t, row[2 + i], inclined ? 1e-12 : 1e-13) << "impact " << i + 1;
        worst = std::max(worst, std::abs(events[i].t - row[2 + i]));
      }
    }
    std::cout << "impacts off by " << worst << " at most\n";
  }
}

// M = K = 1 under 0.1 cos(Omega t).
Model oscillator(double Omega, double damping) {
  Model model;
  model.M = model.K = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Constant(1, 1, damping);
  model.forces.push_back({Eigen::VectorXd::Ones(1), 0.0, {0.1, Omega, 0.0}});
  return model;
}

const State pushed_off{Eigen::VectorXd::Constant(1, 0.3), Eigen::VectorXd::Constant(1, -0.2)};

// Rounding error relative to the largest response until t, including that of the phase.
double resonant_rounding(double damping, double t) {
  const double largest = 0.5 + 0.05 * std::min(t, damping > 0.0 ? 2.0 / damping : t);
  return machine_epsilon * largest * (8.0 + t);
}

// The flow in one step, and up to t = 1000 the ticks of a replica.
TEST(NearResonance, FlowAndTicksMatch50DigitReference) {
  double worst = 0.0;
  for (const auto& row : test::reference_rows("near_resonance")) {
    SCOPED_TRACE(testing::Message()
                 << "Omega - 1 = " << row[0] - 1.0 << ", C = " << row[1] << ", t = " << row[2]);
    const double rounding = resonant_rounding(row[1], row[2]);
    const auto expect_near = [&](const State& here, double roundings) {
      EXPECT_NEAR(here.q[0], row[3], roundings * rounding);
      EXPECT_NEAR(here.u[0], row[4], roundings * rounding);
    };
    const Dynamics dynamics(oscillator(row[0], row[1]));
    const Flow flow(dynamics, 0);
    Motion motion;
    flow.enter(pushed_off.q, pushed_off.u, at(0.0), Eigen::VectorXd(0), motion);
    flow.propagate(motion, at(row[2]), motion);
    State here = pushed_off;
    flow.state(motion, here.q, here.u);
    expect_near(here, 1.0);
    worst = std::max(
        {worst, std::abs(here.q[0] - row[3]) / rounding, std::abs(here.u[0] - row[4]) / rounding});
    if (row[2] > 1000.0) continue;
    constexpr double h = 1.0 / 64.0;
    Replica replica(oscillator(row[0], row[1]), h);
    ReplicaState state;
    replica.start(pushed_off, 0, 0, state);
    for (int k = 0; k < static_cast<int>(row[2] / h); ++k) replica.tick({}, state);
    replica.output(state, here.q, here.u);
    expect_near(here, 8.0);
  }
  std::cout << "off by " << worst << " of the roundings to expect\n";
}

// An undamped oscillator in exact resonance whose amplitude grows up to a stop: q = t sin(t) / 20
// from rest.
TEST(NearResonance, GrowingOscillationHitsStop) {
  Model model = oscillator(1.0, 0.0);
  model.contacts.push_back({Eigen::VectorXd::Constant(1, -1.0), 2.0, {}, 0.0});
  Master master(model, {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)});
  std::vector<ContactEvent> events;
  master.advance(at(60.0), events);
  ASSERT_FALSE(events.empty());
  const double t = events.front().t;
  EXPECT_NEAR(t * std::sin(t), 40.0, 1e-12);
  EXPECT_GT(t, 14 * 3.14);
  EXPECT_LT(t, 14.5 * 3.15);
}

// With both contacts locked, the remaining mode has the frequency of the excitation: both stay
// closed.
TEST(NearResonance, ContactsWithResonantRemainingModeAreHeld) {
  Model model;
  model.M = Eigen::Matrix3d::Identity();
  model.C = Eigen::Matrix3d::Zero();
  model.K = (Eigen::Matrix3d() << 5, -1, -1, -1, 5, -1, -1, -1, 4).finished();
  model.forces.push_back({Eigen::Vector3d(-1, -1, 1), 3.0, {0.3, 2.0, 0.0}});
  for (const Eigen::Index i : {0, 1}) {
    model.contacts.push_back({Eigen::Vector3d::Unit(i), 0.2, {}, 0.0});
  }
  Replica replica(model, 0.01);
  ReplicaState state;
  const State start{Eigen::Vector3d(-0.2, -0.2, 0.0), Eigen::Vector3d::Zero()};
  replica.start(start, 0, bit(0) | bit(1), state);
  ASSERT_EQ(state.motion.flow->locked(), bit(0) | bit(1));
  EXPECT_EQ(state.refused_impacts, 0);
  // z'' + 4 z = 3 - 0.4 + 0.3 cos(2 t) from rest.
  for (int k = 1; k <= 100; ++k) replica.tick({}, state);
  State here = start;
  replica.output(state, here.q, here.u);
  const double z = 0.65 * (1.0 - std::cos(2.0)) + 0.3 / 4.0 * std::sin(2.0);
  EXPECT_NEAR(here.q[2], z, 1e-14);
}

}  // namespace
}  // namespace sprag
