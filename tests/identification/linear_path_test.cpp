#include "sprag/detail/identification/linear_path.h"

#include <gtest/gtest.h>

#include <iostream>

#include "sprag/detail/identification/coupled_step.h"
#include "sprag/detail/identification/free_flight.h"
#include "sprag/detail/mechanics/oscillators.h"
#include "sprag/scene_file.h"
#include "tests/support/random.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

TEST(OscillatorStep, IsWhatTheMatrixExponentialIs) {
  // Vibrating, critical, overdamped, without a spring, and without a damper either.
  for (const auto& [c, k] : {std::pair{0.3, 20.0}, std::pair{2.0, 1.0}, std::pair{5.0, 1.0},
                             std::pair{0.4, 0.0}, std::pair{0.0, 0.0}, std::pair{0.1, 1e-6}}) {
    for (const double tau : {0.01, 0.7, 3.0}) {
      const OscillatorStep step = oscillator_step(0.5 * c, k, tau);
      const Eigen::MatrixXd of =
          coupled_step(Eigen::MatrixXd::Constant(1, 1, c), Eigen::MatrixXd::Constant(1, 1, k),
                       Eigen::MatrixXd::Ones(1, 1), tau);
      Eigen::MatrixXd expected(2, 3);
      expected << step.zz, step.zv, step.z_alpha, step.vz, step.vv, step.zv;
      EXPECT_LT((of - expected).cwiseAbs().maxCoeff(), 1e-12 * (1.0 + of.cwiseAbs().maxCoeff()))
          << c << ' ' << k << ' ' << tau;
    }
  }
}

struct PathOf {
  PathOf(const Scene& scene, const std::vector<std::string>& keys, const Stretches& stretches)
      : family(scene, unknowns_named(scene, keys)),
        machine(family.at(family.nominal())),
        inputs(family.inputs(family.nominal())) {
    set(stretches);
  }

  void set(const Stretches& stretches) {
    flights.set(machine, stretches);
    harmonics.set(machine.frequencies, stretches);
  }

  Path along(const Stretches& stretches, const Eigen::VectorXd& x0) {
    set(stretches);
    Path path;
    follow(machine, flights, harmonics, stretches[0], 0, x0, inputs, path);
    return path;
  }

  MachineFamily family;
  Machine machine;
  Eigen::VectorXd inputs;
  Flights flights;
  Harmonics harmonics;
};

const Stretches some_impacts = {
    {0.2, {{0.5, 0, true, 0}, {1.1, 0, true, 1}, {1.25, 0, true, 2}, {2.0, 0, true, 3}}}};

// By modes, and by coupled oscillators with the same matrices: an entry of K is an unknown, at its
// true value.
TEST(LinearPath, IsTheSameByModesAndByMatrixExponentials) {
  Scene scene = test::shipped_scene("lab_rig");
  scene.model.forces.push_back({Eigen::Vector2d(0.3, -1.0), 2.5, {}});
  PathOf modal(scene, {}, some_impacts);
  PathOf dense(scene, {"system.K.1.2"}, some_impacts);
  ASSERT_TRUE(modal.machine.modal);
  ASSERT_FALSE(dense.machine.modal);
  const Eigen::VectorXd x0 = Eigen::Vector4d(0.01, -0.02, 0.3, 0.5);
  const Path a = modal.along(some_impacts, x0), b = dense.along(some_impacts, x0);
  EXPECT_LT((a.g - b.g).norm(), 1e-12 * a.g.norm());
  EXPECT_LT((a.gamma - b.gamma).norm(), 1e-12 * a.gamma.norm());
  EXPECT_LT((a.gamma_rate - b.gamma_rate).norm(), 1e-12 * a.gamma_rate.norm());
}

TEST(LinearPath, ItsRowsAndDerivativesAreThoseOfThePath) {
  for (const char* name : {"paper_beam", "non_proportional", "bouncing_ball"}) {
    const Scene scene = test::shipped_scene(name);
    PathOf path(scene, {}, some_impacts);
    const Eigen::Index n2 = 2 * path.family.n();
    Random random(7);
    const Eigen::VectorXd x0 = 0.1 * random.vector(n2);
    const Path at = path.along(some_impacts, x0);
    PathRows rows;
    path_rows(path.machine, path.flights, path.harmonics, some_impacts[0], 0, rows);
    Eigen::VectorXd z(n2 + path.inputs.size());
    z << x0, path.inputs;
    EXPECT_LT((rows.A * z - at.g).norm(), 1e-12 * at.g.norm()) << name;
    EXPECT_LT((rows.Gamma * z - at.gamma).norm(), 1e-12 * at.gamma.norm()) << name;
    RowMatrix G;
    time_derivatives(path.machine, path.flights, some_impacts[0], 0, at, G);
    for (std::size_t j = 0; j < 4; ++j) {
      constexpr double h = 1e-6;
      Stretches later = some_impacts, sooner = some_impacts;
      later[0].impacts[j].t += h;
      sooner[0].impacts[j].t -= h;
      const Eigen::VectorXd rate = (path.along(later, x0).g - path.along(sooner, x0).g) / (2.0 * h);
      EXPECT_LT((G.col(static_cast<Eigen::Index>(j)) - rate).norm(), 1e-6 * (1.0 + rate.norm()))
          << name << ", impact " << j;
    }
  }
}

// The free part of the motion from a state.
Eigen::VectorXd free_part(const MachineFamily& family, const State& state, double t) {
  const Machine machine = family.at(family.nominal());
  const Eigen::VectorXd inputs = family.inputs(family.nominal());
  Eigen::VectorXd y = family.to_modes(state.q), u = family.to_modes(state.u);
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const std::complex<double> turn = std::complex<double>(inputs[2 * g], inputs[2 * g + 1]) *
                                      std::polar(1.0, machine.frequencies[g] * t);
    const std::complex<double> rate(0.0, machine.frequencies[g]);
    y -= (machine.response.col(g) * turn).real();
    u -= (machine.response.col(g) * (turn * rate)).real();
  }
  Eigen::VectorXd x(2 * family.n());
  x << y, u;
  return x;
}

// Coupled damping, two contacts, and a constant force that presses both masses onto shaken
// supports.
constexpr const char* pressed = R"(
[system]
M = [[1.0, 0.2], [0.2, 0.6]]
C = [[0.5, -0.1], [-0.1, 0.2]]
K = [[30.0, -12.0], [-12.0, 20.0]]
[[force]]
direction = [0.3, 1.0]
constant = -3.0
amplitude = 4.0
frequency = 3.1
[impact]
restitution = 0.4
[[contact]]
direction = [0.0, 1.0]
clearance = 0.05
motion = { amplitude = 0.004, frequency = 11.0, phase = 0.3 }
[[contact]]
direction = [1.0, -0.2]
clearance = 0.06
[master]
q = [0.1, 0.2]
[replica]
)";

struct ThroughContact {
  ThroughContact(const std::string& name, double duration)
      : scene(name == "pressed" ? parse_scene(pressed, "pressed.toml") : test::shipped_scene(name)),
        path(scene, {}, {}) {
    RecordSettings record;
    record.close = 1e-5;
    record.exact = true;
    record.can_follow = [this](int contact, ContactSet held, ContactSet staying) {
      return is_one_impact(path.machine, contact, held, staying);
    };
    const Stretches all = cut(test::events_of(scene, duration), record, 4);
    stretches.assign(1, all.front());
    for (const Impact& impact : stretches[0].impacts) {
      holding += impact.held != 0 ? 1 : 0;
      passages += static_cast<int>(impact.passed.size());
    }
    x0 = free_part(path.family, scene.truth.start, 0.0);
  }

  Scene scene;
  PathOf path;
  Stretches stretches;
  Eigen::VectorXd x0;
  int holding = 0, passages = 0;
};

const std::pair<const char*, double> with_held_contacts[] = {
    {"paper_beam_chatter", 30.0}, {"two_supports_beam", 3.0}, {"stiff_beam", 6.0},
    {"steel_ruler", 6.0},         {"pressed", 12.0},
};

// From the master's own start the path has zero gap at every impact, with sustained contacts,
// chatter and openings in between.
TEST(LinearPath, IsTheMastersWhileContactsAreHeld) {
  int holding = 0;
  for (const auto& [name, duration] : with_held_contacts) {
    ThroughContact of(name, duration);
    const Path at = of.path.along(of.stretches, of.x0);
    double largest = 0.0;
    for (Eigen::Index k = 0; k < at.g.size(); ++k) {
      largest = std::max(largest, std::abs(at.g[k] / at.gamma[k]));
      EXPECT_LT(at.gamma[k], 0.0) << name << ", impact " << k;
    }
    std::cout << name << ": " << at.g.size() << " impacts, " << of.holding
              << " while others are held, " << of.passages << " passages, within " << largest
              << " s\n";
    EXPECT_LT(largest, 1e-9) << name;
    EXPECT_GT(of.passages, 0) << name;
    holding += of.holding;
  }
  EXPECT_GT(holding, 10);
}

TEST(LinearPath, ItsRowsAndDerivativesAreThoseOfThePathWhileContactsAreHeld) {
  for (const auto& [name, duration] : with_held_contacts) {
    ThroughContact of(name, duration);
    Stretches& stretches = of.stretches;
    if (stretches[0].size() > 40) stretches[0].impacts.resize(40);
    Random random(7);
    const Eigen::VectorXd x0 = of.x0 + 0.01 * of.x0.norm() * random.vector(of.x0.size());
    const Path at = of.path.along(stretches, x0);
    PathRows rows;
    path_rows(of.path.machine, of.path.flights, of.path.harmonics, stretches[0], 0, rows);
    Eigen::VectorXd z(x0.size() + of.path.inputs.size());
    z << x0, of.path.inputs;
    EXPECT_LT((rows.A * z - at.g).norm(), 1e-11 * at.g.norm()) << name;
    EXPECT_LT((rows.Gamma * z - at.gamma).norm(), 1e-11 * at.gamma.norm()) << name;
    RowMatrix G;
    time_derivatives(of.path.machine, of.path.flights, stretches[0], 0, at, G);
    for (std::size_t j = 0; j < stretches[0].size(); ++j) {
      constexpr double h = 1e-7;
      Stretches later = stretches, sooner = stretches;
      later[0].impacts[j].t += h;
      sooner[0].impacts[j].t -= h;
      const Eigen::VectorXd rate =
          (of.path.along(later, x0).g - of.path.along(sooner, x0).g) / (2.0 * h);
      EXPECT_LT((G.col(static_cast<Eigen::Index>(j)) - rate).norm(), 1e-5 * (1.0 + rate.norm()))
          << name << ", impact " << j;
    }
  }
}

// The master's events are impacts of the path from the same start.
TEST(FreeFlight, MeetsTheImpactsOfTheMaster) {
  const Scene scene = test::shipped_scene("paper_beam");
  const auto events = test::events_of(scene, 10.0);
  const MachineFamily family(scene, {});
  const Machine machine = family.at(family.nominal());
  const Eigen::VectorXd inputs = family.inputs(family.nominal());
  const FreeFlight flight(machine, inputs);
  const std::complex<double> e(inputs[0], inputs[1]);
  const std::complex<double> rate = e * std::complex<double>(0.0, machine.frequencies[0]);
  Eigen::VectorXd y = family.to_modes(scene.truth.start.q) - (machine.response.col(0) * e).real();
  Eigen::VectorXd u =
      family.to_modes(scene.truth.start.u) - (machine.response.col(0) * rate).real();
  double t = 0.0;
  for (std::size_t k = 0; k < 8; ++k) {
    const auto next = flight.next_impact(y, u, t, t + 20.0);
    ASSERT_TRUE(next);
    EXPECT_NEAR(next->t, events[k].t, 1e-9);
    flight.move(next->t - t, y, u);
    flight.hit(0, next->t, u);
    t = next->t;
  }
  // Backwards, with each impact undone.
  for (std::size_t k = 8; k-- > 0;) {
    flight.undo_hit(0, t, u);
    EXPECT_LT(flight.gap_velocity(0, u, t), 0.0);
    const auto before = flight.next_impact(y, u, t, 0.01);
    ASSERT_EQ(before.has_value(), k > 0);
    if (!before) break;
    EXPECT_NEAR(before->t, events[k - 1].t, 1e-7);
    EXPECT_EQ(before->contact, 0);
    flight.move(before->t - t, y, u);
    t = before->t;
  }
  flight.move(-t, y, u);
  const Eigen::VectorXd start =
      family.to_modes(scene.truth.start.q) - (machine.response.col(0) * e).real();
  EXPECT_LT((y - start).norm(), 1e-6 * start.norm());
}

}  // namespace
}  // namespace sprag
