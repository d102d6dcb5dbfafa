// The master with sampled inputs against an integration of the same interpolant.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/sampled_input.h"
#include "tests/mechanics/runge_kutta.h"
#include "tests/support/random.h"

namespace sprag::test {
namespace {

constexpr std::size_t most_impacts = 25;

// A sweep with some noise, an acceleration.
SampledInputPointer shaken(Interpolation interpolation, double amplitude, double from, double to,
                           double duration, double rate, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> t, a;
  const auto n = static_cast<int>(std::lround(duration * rate)) + 1;
  for (int k = 0; k < n; ++k) {
    const double time = k / rate;
    const double phase =
        2.0 * std::numbers::pi * (from * time + 0.5 * (to - from) / duration * time * time);
    t.push_back(time);
    a.push_back(amplitude * (std::cos(phase) + random.uniform(-0.1, 0.1)));
  }
  return std::make_shared<const SampledInput>(
      t, a, SampledInput::Settings{.interpolation = interpolation});
}

struct SampledMachine {
  std::string name;
  Model model;
  State start;
  double duration;
  long double step = 2e-5L;  ///< of the reference
};

Model shaken_beam(const Beam& beam, const SampledInputPointer& input) {
  Model model = beam_model(beam);
  model.forces.push_back({inertia_direction(beam), 0.0, {}, input});
  return model;
}

Contact beam_stop(const Beam& beam, double x_c, Side side, double clearance, double restitution,
                  const SampledInputPointer& input) {
  Contact contact = beam_contact(beam, x_c, side, clearance, restitution);
  contact.input = input;
  contact.input_share = input ? (side == Side::below ? 1.0 : -1.0) : 0.0;
  return contact;
}

SampledMachine beam_on_ground(Interpolation interpolation) {
  const Beam beam{.modes = 3, .damping = 0.17};
  const auto input = shaken(interpolation, -3.0, 0.7, 3.0, 8.0, 500.0, 11);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.868, Side::below, 0.0, 0.7, input)};
  return {
      "beam on ground", model, {Eigen::Vector3d(-0.05, 0.0, 0.0), Eigen::Vector3d::Zero()}, 4.0};
}

SampledMachine beam_on_frame(Interpolation interpolation) {
  const Beam beam{.modes = 3, .damping = 0.17};
  const auto input = shaken(interpolation, 5.0, 0.5, 4.0, 8.0, 1000.0, 12);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.9, Side::below, 0.02, 0.6, nullptr)};
  return {"beam on frame", model, {Eigen::Vector3d(-0.04, 0.0, 0.0), Eigen::Vector3d::Zero()}, 4.0};
}

// A mass between two walls of a shaken box.
SampledMachine rattle(Interpolation interpolation) {
  const auto input = shaken(interpolation, 40.0, 5.0, 12.0, 3.0, 2000.0, 13);
  Model model;
  model.M = Eigen::MatrixXd::Constant(1, 1, 0.3);
  model.C = Eigen::MatrixXd::Constant(1, 1, 0.2);
  model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({Eigen::VectorXd::Constant(1, -0.3), 0.0, {}, input});
  model.contacts.push_back({Eigen::VectorXd::Constant(1, 1.0), 0.02, {}, 0.5});
  model.contacts.push_back({Eigen::VectorXd::Constant(1, -1.0), 0.02, {}, 0.5});
  return {"rattle", model, {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 0.1)}, 1.5};
}

// Two coupled masses with damping that couples the modes, each against a stop of its own.
SampledMachine two_stops(Interpolation interpolation) {
  const auto input = shaken(interpolation, 30.0, 3.0, 15.0, 3.0, 2000.0, 14);
  Model model;
  model.M = Eigen::Vector2d(1.0, 0.5).asDiagonal();
  model.C = (Eigen::Matrix2d() << 3.0, -1.0, -1.0, 1.5).finished();
  model.K = (Eigen::Matrix2d() << 900.0, -400.0, -400.0, 700.0).finished();
  model.forces.push_back({-model.M * Eigen::Vector2d::Ones(), 0.0, {}, input});
  model.forces.push_back({Eigen::Vector2d(1.0, 0.0), 0.5, {2.0, 20.0, 0.3}});
  model.contacts.push_back({Eigen::Vector2d(1.0, 0.0), 0.01, {}, 0.6});
  model.contacts.push_back({Eigen::Vector2d(0.0, -1.0), 0.015, {}, 0.6});
  return {"two stops", model, {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.2, 0.0)}, 1.5};
}

SampledMachine many_modes(Interpolation interpolation) {
  const Beam beam{.modes = 20, .bending_stiffness = 0.1, .damping = 0.5};
  const auto input = shaken(interpolation, -1.0, 0.5, 4.0, 4.0, 1000.0, 15);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.8, Side::above, 0.01, 0.5, nullptr)};
  return {"20 modes", model, {Eigen::VectorXd::Zero(20), Eigen::VectorXd::Zero(20)}, 1.5, 5e-6L};
}

class SampledMaster : public ::testing::TestWithParam<Interpolation> {};

TEST_P(SampledMaster, FindsTheImpactTimesOfAFineIntegration) {
  for (const SampledMachine& machine :
       {beam_on_ground(GetParam()), beam_on_frame(GetParam()), rattle(GetParam()),
        two_stops(GetParam()), many_modes(GetParam())}) {
    SCOPED_TRACE(machine.name);
    Master master(machine.model, machine.start);
    std::vector<ContactEvent> events;
    master.advance(at(machine.duration), events, most_impacts);
    const auto expected = RungeKutta(machine.model, machine.start)
                              .impacts(most_impacts, machine.duration, machine.step);
    ASSERT_GE(expected.size(), 5U);
    ASSERT_GE(events.size(), expected.size());
    double worst = 0.0;
    std::size_t compared = 0;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      // The reference does not complete chatters.
      if (events[k].kind != ContactEventKind::pulse) break;
      ASSERT_EQ(events[k].contact, expected[k].contact) << k;
      ASSERT_NEAR(events[k].t, expected[k].t, 1e-9) << k;
      worst = std::max(worst, std::abs(events[k].t - expected[k].t));
      ++compared;
    }
    EXPECT_GE(compared, 5U);
    std::printf("%s: %zu impacts within %.1e, %ld expansions\n", machine.name.c_str(), compared,
                worst, master.expansions());
  }
}

INSTANTIATE_TEST_SUITE_P(Interpolations, SampledMaster,
                         ::testing::Values(Interpolation::linear, Interpolation::spline),
                         [](const auto& of) {
                           return of.param == Interpolation::linear ? "linear" : "spline";
                         });

}  // namespace
}  // namespace sprag::test
