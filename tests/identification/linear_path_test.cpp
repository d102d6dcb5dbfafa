#include "sprag/identification/linear_path.h"

#include <gtest/gtest.h>

#include <iostream>

#include "sprag/identification/coupled_step.h"
#include "sprag/identification/free_flight.h"
#include "sprag/mechanics/oscillators.h"
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

// Modes, and coupled oscillators with the same matrices: an entry of K is sought, at its value.
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

// The master's own events are impacts of the path that begins where it does.
TEST(FreeFlight, MeetsTheImpactsOfTheMaster) {
  const Scene scene = test::shipped_scene("paper_beam");
  const auto events = test::events_of(scene, 10.0);
  const MachineFamily family(scene, {});
  const Machine machine = family.at(family.nominal());
  const Eigen::VectorXd inputs = family.inputs(family.nominal());
  const FreeFlight flight(machine, inputs);
  const std::complex<double> e(inputs[0], inputs[1]);
  const std::complex<double> rate = e * std::complex<double>(0.0, machine.frequencies[0]);
  Eigen::VectorXd y = family.to_modes(scene.master.q) - (machine.response.col(0) * e).real();
  Eigen::VectorXd u = family.to_modes(scene.master.u) - (machine.response.col(0) * rate).real();
  double t = 0.0;
  for (std::size_t k = 0; k < 8; ++k) {
    const auto next = flight.next_impact(y, u, t, t + 20.0);
    ASSERT_TRUE(next);
    EXPECT_NEAR(next->t, events[k].t, 1e-9);
    flight.move(next->t - t, y, u);
    flight.hit(0, next->t, u);
    t = next->t;
  }
  // And back, each impact undone.
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
      family.to_modes(scene.master.q) - (machine.response.col(0) * e).real();
  EXPECT_LT((y - start).norm(), 1e-6 * start.norm());
}

}  // namespace
}  // namespace sprag
