// Long-run motion of machines, compared with closed forms and with finite differences of the
// master.
#include "sprag/detail/analysis/recurrence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "sprag/detail/analysis/lyapunov.h"
#include "sprag/detail/analysis/variation.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/by_speed.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"
#include "tests/support/units.h"

namespace sprag::test {
namespace {

constexpr double weight = 9.81;
constexpr double pi = std::numbers::pi;

// A ball over a table A sin(Omega t).
Scene ball_on_table(double A, double Omega, double epsilon) {
  Scene scene;
  Model& model = scene.model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces = {{Eigen::VectorXd::Ones(1), -weight, {}}};
  model.contacts = {{Eigen::VectorXd::Ones(1), 0.0, {A, Omega, 0.5 * pi}, epsilon}};
  scene.truth.start = {Eigen::VectorXd::Constant(1, 0.01), Eigen::VectorXd::Zero(1)};
  return scene;
}

// A driven mass on a spring and a dashpot, with a stop.
Scene oscillator(double frequency) {
  Scene scene = shipped_scene("impact_oscillator");
  for (Force& force : scene.model.forces) force.harmonic.frequency = frequency;
  return scene;
}

struct Run {
  State end;
  std::vector<ContactEvent> events;
};

Run run(const Flows& flows, const State& start, double t, double until) {
  Master master(flows, start, t, 0);
  Run run;
  master.advance(at(until), run.events);
  const Eigen::Index f = start.q.size();
  run.end = {Eigen::VectorXd(f), Eigen::VectorXd(f)};
  master.state(at(until), run.end.q, run.end.u);
  return run;
}

bool same_kinds(const Run& a, const Run& b) {
  return std::equal(a.events.begin(), a.events.end(), b.events.begin(), b.events.end(),
                    [](const ContactEvent& x, const ContactEvent& y) {
                      return x.contact == y.contact && x.kind == y.kind;
                    });
}

State moved(State state, const Eigen::VectorXd& q, const Eigen::VectorXd& u, double by) {
  state.q += by * q;
  state.u += by * u;
  return state;
}

// Central difference quotient of the master for an initial difference (q, u).
struct Quotient {
  Eigen::VectorXd q, u;
  bool regular = false;
};
Quotient quotient(const Flows& flows, const State& start, double t, double until,
                  const Eigen::VectorXd& q, const Eigen::VectorXd& u, double by) {
  const Run here = run(flows, start, t, until);
  const Run above = run(flows, moved(start, q, u, by), t, until);
  const Run below = run(flows, moved(start, q, u, -by), t, until);
  return {(above.end.q - below.end.q) / (2.0 * by), (above.end.u - below.end.u) / (2.0 * by),
          same_kinds(here, above) && same_kinds(here, below)};
}

TEST(Variation, EqualsDerivativeOfMotion) {
  constexpr double T = 1.0;
  int impacts = 0;
  int compared = 0;
  int dependent = 0;
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 120; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    ImpactingMachine machine = random_impacting_machine(random);
    if (seed % 2 == 0) test::let_restitutions_fall(random, 3.0, machine.model);
    const Flows flows(machine.model);
    const Eigen::Index f = machine.model.coordinates();
    const Eigen::VectorXd q = random.vector(f);
    const Eigen::VectorXd u = random.vector(f);
    Master master(flows, machine.start, 0.0, 0);
    std::vector<ContactEvent> events;
    master.advance(at(0.0), events);
    Variation variation(master, 1);
    variation.set(at(0.0), q, u);
    variation.advance(at(T), events);
    if (events.empty()) continue;
    const Quotient coarse = quotient(flows, machine.start, 0.0, T, q, u, 1e-6);
    const Quotient fine = quotient(flows, machine.start, 0.0, T, q, u, 5e-7);
    if (!coarse.regular || !fine.regular) continue;
    // Error of the quotient by curvature.
    const double off = (coarse.u - fine.u).norm() + (coarse.q - fine.q).norm();
    const double size = fine.u.norm() + fine.q.norm();
    if (off > 1e-5 * (1.0 + size)) continue;
    const double bound = 4.0 * off + 1e-6 * (1.0 + size);
    EXPECT_LT((variation.q().col(0) - fine.q).norm(), bound);
    EXPECT_LT((variation.u().col(0) - fine.u).norm(), bound);
    impacts += static_cast<int>(events.size());
    ++compared;
    dependent += machine.model.contacts.size() > 1 ? 1 : 0;
    held += std::any_of(events.begin(), events.end(), [](const ContactEvent& event) {
      return event.kind == ContactEventKind::opens;
    });
  }
  std::printf("%d machines, %d with several contacts, %d with a release, %d events\n", compared,
              dependent, held, impacts);
  EXPECT_GT(compared, 60);
  EXPECT_GT(dependent, 20);
  EXPECT_GT(held, 10);
}

TEST(Variation, RefusesPenetratingStart) {
  Scene scene = shipped_scene("bouncing_ball");
  scene.truth.start.q[0] = -0.1;
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  master.advance(at(0.0), events);
  Variation variation(master, 1);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(1, 1);
  EXPECT_THROW(variation.set(at(0.0), one, one), SimulationError);
}

TEST(Lyapunov, ExponentOfFreeOscillatorEqualsDampingRate) {
  Scene scene = oscillator(34.0);
  scene.model.contacts.clear();
  const RecurrenceSettings settings{.transient = 2000, .periods = 40, .lyapunov = true};
  const Recurrence found = recurrence(scene.model, scene.truth.start, settings);
  EXPECT_EQ(found.attractor_period, 1);
  EXPECT_EQ(found.impacts_per_period, 0.0);
  EXPECT_NEAR(found.lyapunov, -0.5 * scene.model.C(0, 0) / scene.model.M(0, 0), 1e-11);
  // The same without force, before the transient has decayed: only sampled at a lower rate.
  scene.model.forces.clear();
  const Flows flows(scene.model);
  Master master(flows, scene.truth.start, 0.0, 0);
  std::vector<ContactEvent> events;
  master.advance(stroboscope_instant(0, 0.1), events);
  const double exponent = largest_exponent(master, 0.1, 0, 4000, events);
  // The difference's length stays between the axes of an ellipse.
  EXPECT_NEAR(exponent, -0.4, std::log(2.0 * pi / 0.1 / 20.0) / (3600 * 0.1));
  // Overdamped: the exponent of the slow eigenvalue.
  scene.model.C(0, 0) = 50.0;
  const Recurrence slow =
      recurrence(scene.model, scene.truth.start,
                 {.period = 0.1, .transient = 100, .periods = 8, .lyapunov = true});
  EXPECT_NEAR(slow.lyapunov, -25.0 + std::sqrt(625.0 - 400.0), 1e-10);
}

TEST(Recurrence, BallOnATableInClosedForm) {
  constexpr double Omega = 60.0;
  constexpr double epsilon = 0.8;
  constexpr double T = 2.0 * pi / Omega;
  constexpr double A = 1.5 * weight * pi * (1.0 - epsilon) / (1.0 + epsilon) / (Omega * Omega);
  // At the impact, cos(Omega t) = (1 - eps) / (1 + eps) pi g / (A Omega^2), and u = g T / 2 after
  // it.
  const double phase =
      std::acos((1.0 - epsilon) / (1.0 + epsilon) * pi * weight / A / Omega / Omega);
  const double tau = T - phase / Omega;
  const double u = 0.5 * weight * T;
  const Eigen::Vector2d point(A * std::sin(phase) + u * tau - 0.5 * weight * tau * tau,
                              u - weight * tau);
  Scene scene = ball_on_table(A, Omega, epsilon);
  scene.truth.start = {1.001 * point.head(1), 0.999 * point.tail(1)};
  const Recurrence found =
      recurrence(scene.model, scene.truth.start, {.transient = 1000, .lyapunov = true});
  EXPECT_DOUBLE_EQ(found.period, T);
  EXPECT_EQ(found.attractor_period, 1);
  EXPECT_EQ(found.impacts_per_period, 1.0);
  EXPECT_NEAR(found.attractor[0], point[0], 1e-10 * A);
  EXPECT_NEAR(found.attractor[1], point[1], 1e-10 * u);
  // Its multipliers are complex; their product is the impact's determinant epsilon^2.
  EXPECT_NEAR(found.lyapunov, std::log(epsilon) / T, 1e-9 / T);
}

// With impacts exactly at the instants of the stroboscope.
TEST(Recurrence, ShippedOscillatorHasOneImpactPerPeriod) {
  const Scene scene = shipped_scene("impact_oscillator");
  const Recurrence found =
      recurrence(scene.model, scene.truth.start, {.transient = 50, .lyapunov = true});
  EXPECT_EQ(found.attractor_period, 1);
  EXPECT_EQ(found.impacts_per_period, 1.0);
  EXPECT_NEAR(found.attractor[0], scene.truth.start.q[0], 1e-12);
  EXPECT_NEAR(found.attractor[1], scene.truth.start.u[0], 1e-9);
  const double T = 2.0 * pi / 34.0;
  EXPECT_LT(found.lyapunov, 0.0);
  EXPECT_GE(found.lyapunov, std::log(0.7) / T - 0.4 - 1e-9);
}

// det of the monodromy matrix: a factor epsilon^2 per impact, and the decay by damping.
TEST(Recurrence, VolumeContractsByRestitutionAndDamping) {
  const Scene scene = oscillator(25.0);
  const double T = 2.0 * pi / 25.0;
  const Flows flows(scene.model);
  Master master(flows, scene.truth.start, 0.0, 0);
  std::vector<ContactEvent> events;
  const long impacts_before = master.impacts();
  master.advance(stroboscope_instant(0, T), events);
  for (long k = 0; k < 20; ++k) {
    const long impacts = master.impacts();
    const Eigen::MatrixXd A = monodromy(master, T, k, k + 1, events);
    const double epsilon = std::pow(0.7, 2.0 * static_cast<double>(master.impacts() - impacts));
    const double expected = epsilon * std::exp(-0.8 * T);
    EXPECT_NEAR(A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0), expected,
                1e-9 * expected * (1.0 + A.squaredNorm()));
  }
  EXPECT_GT(master.impacts() - impacts_before, 10);
}

// A chaotic orbit: the exponent by differences of the stroboscopic map, period by period.
TEST(Lyapunov, ExponentOfChaoticOrbitMatchesPoincareMap) {
  constexpr double Omega = 60.0;
  constexpr double T = 2.0 * pi / Omega;
  const Scene scene = ball_on_table(8.0 * weight / (Omega * Omega), Omega, 0.8);
  constexpr long first = 200;
  constexpr long n = 400;
  const Flows flows(scene.model);
  Master master(flows, scene.truth.start, 0.0, 0);
  std::vector<ContactEvent> events;
  for (long k = 0; k <= first; ++k) master.advance(stroboscope_instant(k, T), events);
  const double exponent = largest_exponent(master, T, first, first + n, events);

  // The points must be on the same orbit, because other orbits diverge from it.
  Master again(flows, scene.truth.start, 0.0, 0);
  Eigen::VectorXd d_q = Eigen::VectorXd::Constant(1, std::cos(1.0));
  Eigen::VectorXd d_u = Eigen::VectorXd::Constant(1, Omega * std::sin(1.0));
  State point{Eigen::VectorXd(1), Eigen::VectorXd(1)};
  double sum = 0.0;
  for (long k = 0; k < n; ++k) {
    const double length = std::hypot(d_u[0], Omega * d_q[0]);
    d_q /= length;
    d_u /= length;
    const Instant t = stroboscope_instant(first + k, T);
    const double until = stroboscope_instant(first + k + 1, T).hi;
    again.advance(t, events);
    again.state(t, point.q, point.u);
    const Quotient map = quotient(flows, point, t.hi, until, d_q, d_u, 1e-8);
    ASSERT_TRUE(map.regular) << k;
    d_q = map.q;
    d_u = map.u;
    if (k >= n / 10) sum += std::log(std::hypot(d_u[0], Omega * d_q[0]));
  }
  EXPECT_GT(exponent, 1.0);
  EXPECT_NEAR(exponent * T, sum / (n - n / 10), 1e-3);
}

TEST(Lyapunov, SpectralRadius) {
  EXPECT_NEAR(spectral_radius((Eigen::Matrix2d() << 1.0, 2.0, -2.0, 1.0).finished()),
              std::sqrt(5.0), 1e-14);
  EXPECT_NEAR(spectral_radius((Eigen::Matrix2d() << -3.0, 1.0, 0.0, 2.0).finished()), 3.0, 1e-14);
  EXPECT_NEAR(spectral_radius((Eigen::Matrix2d() << 0.5, 1e9, 0.0, 0.5).finished()), 0.5, 1e-10);
  EXPECT_EQ(spectral_radius((Eigen::Matrix2d() << 0.0, 1.0, 0.0, 0.0).finished()), 0.0);
}

// A ball at rest on a table that does not release it is independent of its start.
TEST(Recurrence, MonodromyVanishesAtRest) {
  const Scene scene = shipped_scene("bouncing_ball");
  const Recurrence found =
      recurrence(scene.model, scene.truth.start,
                 {.period = 0.5, .transient = 20, .periods = 8, .lyapunov = true});
  EXPECT_EQ(found.attractor_period, 1);
  EXPECT_EQ(found.lyapunov, -infinity);
  EXPECT_EQ(found.impacts_per_period, 0.0);
}

TEST(Recurrence, DoesNotDependOnUnits) {
  for (const double frequency : {25.0, 28.0, 36.0}) {
    const Scene scene = oscillator(frequency);
    const RecurrenceSettings settings{.transient = 100, .periods = 80, .lyapunov = true};
    const Recurrence expected = recurrence(scene.model, scene.truth.start, settings);
    for (const Units units : {Units{7, -3, 5}, Units{-12, 4, -9}}) {
      const Scene other = in_units(units, scene);
      const Recurrence found = recurrence(other.model, other.truth.start, settings);
      EXPECT_EQ(found.period, units.of_time(expected.period));
      EXPECT_EQ(found.attractor_period, expected.attractor_period);
      EXPECT_EQ(found.impacts_per_period, expected.impacts_per_period);
      EXPECT_EQ(found.points.col(0), expected.points.col(0) * units.of_length(1.0));
      EXPECT_EQ(found.points.col(1), expected.points.col(1) * units.of_velocity(1.0));
      EXPECT_NEAR(units.of_time(found.lyapunov), expected.lyapunov,
                  1e-12 * std::abs(expected.lyapunov));
    }
  }
}

TEST(Recurrence, RequiresOneFrequencyOrGivenPeriod) {
  Scene scene = oscillator(34.0);
  scene.model.forces.push_back(scene.model.forces.front());
  EXPECT_NO_THROW(recurrence(scene.model, scene.truth.start, {.periods = 4}));
  scene.model.forces.back().harmonic.frequency = 35.0;
  EXPECT_THROW(recurrence(scene.model, scene.truth.start, {.periods = 4}), std::invalid_argument);
  EXPECT_NO_THROW(recurrence(scene.model, scene.truth.start, {.period = 0.1, .periods = 4}));
  scene.model.forces.clear();
  EXPECT_THROW(recurrence(scene.model, scene.truth.start, {.periods = 4}), std::invalid_argument);
  EXPECT_THROW(recurrence(scene.model, scene.truth.start, {.period = 1.0, .periods = 0}),
               std::invalid_argument);
}

TEST(Recurrence, FindsTheSmallestPeriodOfPoints) {
  const Eigen::Vector2d weights(4.0, 1.0);
  for (int p = 1; p <= 12; ++p) {
    Simulation::Rows points(50, 2);
    for (int k = 0; k < 50; ++k) {
      // The first half is ignored as transient.
      const double off = k < 25 ? 1.0 / (k + 1) : 1e-9 * std::sin(k);
      points.row(k) << std::cos(2.0 * pi * k / p) + off, k % p;
    }
    EXPECT_EQ(period_of_points(points, weights, 32, 1e-6), p);
    EXPECT_EQ(period_of_points(points, weights, p - 1, 1e-6), 0);
    EXPECT_EQ(period_of_points(points, weights, 32, 1e-12), 0);
  }
}

}  // namespace
}  // namespace sprag::test
