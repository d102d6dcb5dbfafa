// The kernel of a study's run: random draws, disturbed events, figures of a run.
#include "python/src/trial.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "python/src/random.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"

namespace sprag::python {
namespace {

TEST(Philox, GivesTheKnownAnswers) {
  // kat_vectors of Random123, the authors' reference library.
  using Block = std::array<std::uint32_t, 4>;
  EXPECT_EQ(philox({}, {}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(philox({ones, ones, ones, ones}, {ones, ones}),
            (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Random, IsNormalAndAStreamForEachRunAndPurpose) {
  constexpr int count = 100000;
  double sum = 0.0, squares = 0.0, fourth = 0.0;
  Random random(7, 12345678901, Purpose::jitter);
  for (int i = 0; i < count; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
  }
  // Within five standard deviations of the sample's moments.
  EXPECT_NEAR(sum / count, 0.0, 5.0 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 1.0, 5.0 * std::sqrt(2.0 / count));
  EXPECT_NEAR(fourth / count, 3.0, 5.0 * std::sqrt(96.0 / count));

  std::set<double> first;
  for (const std::uint64_t seed : {1, 2}) {
    for (const std::uint64_t run : {0U, 1U, 4294967295U}) {
      for (const Purpose purpose : {Purpose::jitter, Purpose::losses, Purpose::axes}) {
        first.insert(Random(seed, run, purpose).uniform());
        first.insert(Random(seed, run + (std::uint64_t{1} << 32U), purpose).uniform());
      }
    }
  }
  EXPECT_EQ(first.size(), 2U * 3U * 3U * 2U);
  EXPECT_EQ(Random(3, 4, Purpose::axes).normal(), Random(3, 4, Purpose::axes).normal());
}

Scene scene_of(const std::string& name) {
  return read_scene(SPRAG_SOURCE_DIR "/scenes/" + name + ".toml");
}

TEST(Starts, HaveTheirEnergyAndAreOutsideOfSupports) {
  for (const char* name : {"lab_rig", "paper_beam", "three_ball_chain"}) {
    const Scene scene = scene_of(name);
    const ErrorEnergy energy(scene.model);
    std::set<double> starts;
    for (std::uint64_t run = 0; run < 20; ++run) {
      Scene machine = scene, observer = scene;
      draw_starts(1, run, 1e-3, 0.3, machine, observer);
      const State& start = machine.truth.start;
      const auto from_machine = [&](const State& a) {
        return energy(start.q, start.u, a.q, a.u)[0];
      };
      EXPECT_NEAR(from_machine(observer.prior.start), 0.3, 1e-9) << name;
      EXPECT_NEAR(from_machine(scene.truth.start), 1e-3, 1e-11) << name;
      for (const Contact& contact : scene.model.contacts) {
        EXPECT_GE(gap(contact, start.q, 0.0), 0.0) << name;
      }
      starts.insert(start.u[0]);
    }
    EXPECT_EQ(starts.size(), 20U);
  }
}

std::vector<ContactEvent> events_of_rig() {
  const Scene scene = scene_of("lab_rig");
  return simulate(scene.model, scene.truth.start, 100.0, 0.0).events;
}

TEST(Disturbance, HasGivenSize) {
  const std::vector<ContactEvent> events = events_of_rig();
  ASSERT_GT(events.size(), 300U);
  EXPECT_EQ(disturb(events, {}, 1, 100.0, 1, 0), events);

  const auto jittered = disturb(events, {.jitter = 1e-4}, 1, 1e9, 1, 5);
  ASSERT_EQ(jittered.size(), events.size());
  double squares = 0.0;
  for (std::size_t i = 0; i < events.size(); ++i) {
    squares += std::pow((jittered[i].t - events[i].t) / 1e-4, 2);
  }
  const auto n = static_cast<double>(events.size());
  EXPECT_NEAR(squares / n, 1.0, 5.0 * std::sqrt(2.0 / n));
  const auto more = disturb(events, {.jitter = 2e-4, .lost = 0.0}, 1, 1e9, 1, 5);
  EXPECT_NEAR(more[7].t - events[7].t, 2.0 * (jittered[7].t - events[7].t), 1e-12);

  const auto with_loss = [&](double lost) { return disturb(events, {.lost = lost}, 1, 1e9, 1, 5); };
  const auto few = with_loss(0.4), many = with_loss(0.1);
  EXPECT_LT(few.size(), many.size());
  for (const ContactEvent& event : few) {
    EXPECT_NE(std::find(events.begin(), events.end(), event), events.end());
  }
  const auto pulses = disturb({}, {.spurious = 3.0}, 2, 100.0, 1, 5);
  EXPECT_NEAR(static_cast<double>(pulses.size()), 600.0, 5.0 * std::sqrt(600.0));
  for (std::size_t i = 1; i < pulses.size(); ++i) EXPECT_GE(pulses[i].t, pulses[i - 1].t);
}

TEST(Figures, CountContactsThatAreClosedAtTheStart) {
  Scene scene = scene_of("bouncing_ball");
  scene.truth.start = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)};
  scene.prior.start = {Eigen::VectorXd::Constant(1, 0.1), Eigen::VectorXd::Zero(1)};
  const Truth truth = run_machine(scene, 4.0, 0.0, 40);
  ASSERT_EQ(truth.events.size(), 1U);
  ASSERT_EQ(truth.events[0].t, 0.0);
  // The replica falls, and stays at rest where it lands.
  EXPECT_LT(follow(EstimatorKind::replica, scene, truth.events, truth).V.back(), 1e-20);
  EXPECT_GT(follow(EstimatorKind::replica, scene, {}, truth).V.back(), 1.0);
}

}  // namespace
}  // namespace sprag::python
