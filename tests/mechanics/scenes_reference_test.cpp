// Shipped scenes compared with closed forms, with wave theory, and with an integrator that shares
// no code with the library.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "tests/mechanics/runge_kutta.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

void expect_impacts_as_integrated(const char* name, double T, long double h) {
  const Scene scene = shipped_scene(name);
  const std::vector<ContactEvent> events = events_of(scene, T);
  const auto expected = RungeKutta(scene.model, scene.truth.start).impacts(10, T, h);
  ASSERT_EQ(expected.size(), 10U);
  ASSERT_GE(events.size(), expected.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(events[i].kind, ContactEventKind::pulse) << "impact " << i + 1;
    EXPECT_NEAR(events[i].t, expected[i].t, 1e-9) << "impact " << i + 1;
    worst = std::max(worst, std::abs(events[i].t - expected[i].t));
  }
  std::cout << name << ": first ten impacts until t = " << expected.back().t << " differ by "
            << worst << " from those integrated\n";
}

TEST(LabRig, ImpactTimesAgreeWithAnIntegration) {
  expect_impacts_as_integrated("lab_rig", 20.0, 1e-5L);
}

TEST(NonProportional, EqualsPaperBeamWithTipDamper) {
  const Model model = shipped_scene("non_proportional").model;
  const Beam beam{
      .modes = 3, .length = 1.0, .bending_stiffness = 1.0, .mass_per_length = 1.0, .damping = 0.17};
  const Eigen::VectorXd tip = mode_shapes(beam, 1.0);
  Eigen::MatrixXd C = damping(beam).asDiagonal();
  C += 0.05 * tip * tip.transpose();
  EXPECT_LE((model.M - Eigen::MatrixXd(mass(beam).asDiagonal())).norm(), 1e-15);
  EXPECT_LE((model.K - Eigen::MatrixXd(stiffness(beam).asDiagonal())).norm(), 1e-12);
  EXPECT_LE((model.C - C).norm(), 1e-14);
  EXPECT_LE((model.contacts[0].w - mode_shapes(beam, 0.868)).norm(), 1e-14);
  const Force& force = model.forces.at(0);
  EXPECT_LE(
      (force.direction * force.harmonic.amplitude + inertia_direction(beam) * 0.03 * 9.5 * 9.5)
          .norm(),
      1e-14);
  EXPECT_EQ(Flows(model)[0].path(), FlowPath::dense);
}

TEST(NonProportional, ImpactTimesAgreeWithAnIntegration) {
  expect_impacts_as_integrated("non_proportional", 20.0, 2e-5L);
}

// m x'' + b x' + k x = F cos(Omega t + phi), stop at x = -c. With delta = b / 2m, omega the damped
// frequency, X and theta the amplitude and lag of the steady motion and psi = phi - theta, the
// motion after an impact at t = 0 is
//
//   x = X cos(Omega t + psi) + e^(-delta t) A (cos omega t + beta sin omega t).
//
// One period T later the steady part is the same, so that x(0) = x(T) = -c gives beta, and
// x'(0) = -epsilon x'(T), with P A and Q A the rates of the transient at 0 and T, gives
//
//   beta = (1 - e C) / (e S)             e = e^(-delta T), C = cos omega T, S = sin omega T
//   X cos psi = -c - A                   X Omega sin psi = A (P + epsilon Q) / (1 + epsilon)
//   P = omega beta - delta               Q = e (P C - (delta beta + omega) S)
//
// and, psi eliminated, a quadratic equation for A.
struct OneImpactOrbit {
  double phase, velocity;  ///< phi and x'(0)
};

struct Oscillator {
  explicit Oscillator(const Model& model)
      : m(model.M(0, 0)),
        delta(model.C(0, 0) / m / 2.0),
        kappa(model.K(0, 0) / m),
        Omega(model.forces.at(0).harmonic.frequency),
        amplitude(model.forces.at(0).harmonic.amplitude / m),
        c(model.contacts.at(0).clearance),
        epsilon(model.contacts.at(0).restitution),
        X(amplitude / std::hypot(kappa - Omega * Omega, 2.0 * delta * Omega)),
        theta(std::atan2(2.0 * delta * Omega, kappa - Omega * Omega)) {}

  OneImpactOrbit one_impact_orbit() const {
    const double T = 2.0 * std::numbers::pi / Omega;
    const double omega = std::sqrt(kappa - delta * delta);
    const double e = std::exp(-delta * T);
    const double C = std::cos(omega * T);
    const double S = std::sin(omega * T);
    const double beta = (1.0 - e * C) / (e * S);
    const double P = omega * beta - delta;
    const double Q = e * (P * C - (delta * beta + omega) * S);
    const double slope = (P + epsilon * Q) / (1.0 + epsilon) / Omega;
    // (slope A)^2 + (c + A)^2 = X^2; its other root leaves the stop with x' < 0.
    const double a = 1.0 + slope * slope;
    const double A = (-c - std::sqrt(c * c - a * (c * c - X * X))) / a;
    const double psi = std::atan2(slope * A, -c - A);
    return {psi + theta, -slope * A * Omega + P * A};
  }

  double m, delta, kappa, Omega, amplitude, c, epsilon, X, theta;
};

TEST(ImpactOscillator, StaysOnTheOrbitWithOneImpactAPeriod) {
  const Scene scene = shipped_scene("impact_oscillator");
  const Oscillator oscillator(scene.model);
  const OneImpactOrbit orbit = oscillator.one_impact_orbit();
  EXPECT_NEAR(scene.model.forces[0].harmonic.phase, orbit.phase, 1e-14);
  EXPECT_NEAR(scene.truth.start.u[0], orbit.velocity, 1e-15);
  EXPECT_EQ(scene.truth.start.q[0], -oscillator.c);
  EXPECT_GT(orbit.velocity, 0.0);

  const double period = 2.0 * std::numbers::pi / oscillator.Omega;
  const std::vector<ContactEvent> events = events_of(scene, 20.5 * period);
  ASSERT_EQ(events.size(), 20U);
  double worst = 0.0;
  for (std::size_t k = 0; k < events.size(); ++k) {
    EXPECT_EQ(events[k].kind, ContactEventKind::pulse);
    worst = std::max(worst, std::abs(events[k].t - static_cast<double>(k + 1) * period));
  }
  EXPECT_LE(worst, 1e-12);
  std::cout << "impact_oscillator: impact times over 20 periods off by " << worst << '\n';
}

double slope_of(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<Eigen::Index>(x.size());
  const Eigen::ArrayXd X = Eigen::Map<const Eigen::ArrayXd>(x.data(), n);
  const Eigen::ArrayXd Y = Eigen::Map<const Eigen::ArrayXd>(y.data(), n);
  return ((X - X.mean()) * (Y - Y.mean())).sum() / (X - X.mean()).square().sum();
}

// The steady motion without impacts has the amplitude X. A stop at X - mu is hit with the velocity
// Omega sqrt(2 X mu - mu^2): this square root is the singularity of grazing.
TEST(ImpactOscillator, GrazingFollowsTheSquareRootLaw) {
  Scene scene = shipped_scene("impact_oscillator");
  const Oscillator oscillator(scene.model);
  const double X = oscillator.X;
  const double Omega = oscillator.Omega;
  scene.model.forces[0].harmonic.phase = oscillator.theta;  // x = X cos(Omega t)
  scene.truth.start.q[0] = X;
  scene.truth.start.u[0] = 0.0;
  std::vector<double> log_mu;
  std::vector<double> log_deviation;
  for (double exponent = -8.0; exponent < -5.9; exponent += 0.25) {
    const double mu = X * std::pow(10.0, exponent);
    scene.model.contacts[0].clearance = X - mu;
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> events;
    Eigen::VectorXd q(1);
    Eigen::VectorXd u(1);
    master.advance(at(std::numbers::pi / Omega), events);
    ASSERT_EQ(events.size(), 1U) << "mu / X = 1e" << exponent;
    const double t = events[0].t;
    EXPECT_NEAR(t * Omega, std::acos(-(X - mu) / X), 1e-10);
    master.state(at(t), q, u);
    const double hit = Omega * std::sqrt(2.0 * X * mu - mu * mu);
    const double jump = u[0] + X * Omega * std::sin(Omega * t);
    EXPECT_NEAR(jump / ((1.0 + oscillator.epsilon) * hit), 1.0, 1e-6);

    // A quarter of a period later, when the impact has changed both position and velocity.
    const double later = 1.5 * std::numbers::pi / Omega;
    master.advance(at(later), events);
    ASSERT_EQ(events.size(), 1U);
    master.state(at(later), q, u);
    log_mu.push_back(std::log10(mu));
    log_deviation.push_back(std::log10(std::hypot(Omega * (q[0] - X * std::cos(Omega * later)),
                                                  u[0] + X * Omega * std::sin(Omega * later))));
  }
  const double slope = slope_of(log_mu, log_deviation);
  EXPECT_NEAR(slope, 0.5, 0.02);
  std::cout << "impact_oscillator: deviation after grazing falls with slope " << slope << '\n';
}

// Steel bar of length L in n linear elements with lumped masses, free at both ends; the contact of
// node 1 with a wall.
constexpr double E = 210e9, rho = 7800.0, S = 3.14e-4, L = 1.0, speed = 0.1, distance = 5e-5;

Scene elastic_bar(int n) {
  Scene scene;
  const Eigen::Index nodes = n + 1;
  const double mass = rho * S * L / n;
  const double stiffness = E * S * n / L;
  Model& model = scene.model;
  model.M = model.C = model.K = Eigen::MatrixXd::Zero(nodes, nodes);
  for (Eigen::Index i = 0; i < n; ++i) {
    model.M(i, i) += mass / 2.0;
    model.M(i + 1, i + 1) += mass / 2.0;
    model.K(i, i) += stiffness;
    model.K(i + 1, i + 1) += stiffness;
    model.K(i, i + 1) = model.K(i + 1, i) = -stiffness;
  }
  model.contacts.push_back({Eigen::VectorXd::Unit(nodes, 0), distance, {}, 0.0});
  scene.truth.start = {Eigen::VectorXd::Zero(nodes), Eigen::VectorXd::Constant(nodes, -speed)};
  return scene;
}

TEST(ElasticBar, SceneEqualsBarOfHundredElements) {
  const Scene scene = shipped_scene("elastic_bar");
  const Scene expected = elastic_bar(100);
  const double k = expected.model.K.norm();
  EXPECT_LE((scene.model.M - expected.model.M).norm(), 1e-15);
  EXPECT_LE((scene.model.K - expected.model.K).norm(), 1e-15 * k);
  EXPECT_EQ(scene.model.C.norm(), 0.0);
  EXPECT_EQ(scene.model.contacts[0].w, expected.model.contacts[0].w);
  EXPECT_EQ(scene.model.contacts[0].clearance, distance);
  EXPECT_EQ(scene.model.contacts[0].restitution, 0.0);
  EXPECT_EQ(scene.truth.start.q, expected.truth.start.q);
  EXPECT_EQ(scene.truth.start.u, expected.truth.start.u);
}

struct BarImpact {
  double start, duration, impulse, kept;
  std::size_t events;
};

BarImpact bar_impact(int n) {
  const Scene scene = elastic_bar(n);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  State x = scene.truth.start;
  master.advance(at(2e-3), events);
  master.state(at(2e-3), x.q, x.u);
  const Eigen::VectorXd momentum = scene.model.M * (x.u - scene.truth.start.u);
  const double energy = 0.5 * x.u.dot(scene.model.M * x.u) + 0.5 * x.q.dot(scene.model.K * x.q);
  const double energy_before = 0.5 * rho * S * L * speed * speed;
  return {events.front().t, events.back().t - events.front().t, momentum.sum(),
          energy / energy_before, events.size()};
}

// The wave that returns from the free end ends the contact. Numerical dispersion widens its front
// like n^(-2/3) L, which determines the order of the errors. The first node stops permanently, so
// that its mass takes 1 / 2n of the energy.
TEST(ElasticBar, ContactConvergesToWaveTheory) {
  const double duration = 2.0 * L / std::sqrt(E / rho);
  const double impulse = 2.0 * rho * S * L * speed;
  std::vector<double> log_n;
  std::vector<double> log_late;
  std::vector<double> log_missing;
  for (const int n : {25, 50, 100, 200}) {
    const BarImpact impact = bar_impact(n);
    const double late = impact.duration / duration - 1.0;
    const double missing = 1.0 - impact.impulse / impulse;
    std::cout << "elastic_bar, " << n << " elements: " << impact.events << " events, from "
              << impact.start << " for " << impact.duration << " s (too long by " << late
              << "), impulse " << impact.impulse << " N s (too small by " << missing
              << "), energy kept " << impact.kept << '\n';
    EXPECT_NEAR(impact.start, distance / speed, 1e-12);
    EXPECT_LE(impact.kept, 1.0 - 0.5 / n + 1e-12);
    EXPECT_GE(impact.kept, 1.0 - 0.6 / n);
    ASSERT_GT(late, 0.0);
    ASSERT_GT(missing, 0.0);
    log_n.push_back(std::log(n));
    log_late.push_back(std::log(late));
    log_missing.push_back(std::log(missing));
  }
  EXPECT_NEAR(slope_of(log_n, log_late), -2.0 / 3.0, 0.1);
  EXPECT_NEAR(slope_of(log_n, log_missing), -2.0 / 3.0, 0.1);
  EXPECT_LT(std::exp(log_late.back()), 0.01);
  EXPECT_LT(std::exp(log_missing.back()), 0.01);
  std::cout << "elastic_bar: errors of duration and impulse fall with slopes "
            << slope_of(log_n, log_late) << " and " << slope_of(log_n, log_missing) << '\n';
}

}  // namespace
}  // namespace sprag::test
