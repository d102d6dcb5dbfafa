// The energy scale of a machine's motion, compared with the result by hand for one coordinate. An
// estimator without a specified uncertainty starts from it. tests/filter/units_test.cpp shows that
// it scales with the units.
#include "sprag/detail/mechanics/scale.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sprag {
namespace {

constexpr double m = 2.0, c = 0.6, k = 50.0;

// m q'' + c q' + k q = forces, with a support at q = -clearance.
Model oscillator(double stiffness) {
  Model model;
  model.M = Eigen::MatrixXd::Constant(1, 1, m);
  model.C = Eigen::MatrixXd::Constant(1, 1, c);
  model.K = Eigen::MatrixXd::Constant(1, 1, stiffness);
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, 0.5, {}});
  return model;
}

State at_rest() { return {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)}; }

TEST(EnergyScale, IsZeroWithoutStartAndForces) {
  EXPECT_EQ(energy_scale(oscillator(k), at_rest()), 0.0);
  EXPECT_EQ(length_scale(oscillator(k), at_rest()), 1.0);
}

TEST(EnergyScale, EqualsEnergyOfStart) {
  const State start{Eigen::VectorXd::Constant(1, 0.1), Eigen::VectorXd::Constant(1, -3.0)};
  EXPECT_DOUBLE_EQ(energy_scale(oscillator(k), start), 0.5 * k * 0.01 + 0.5 * m * 9.0);
}

TEST(EnergyScale, OfWeightEqualsEnergyOfRestOrFall) {
  Model model = oscillator(k);
  model.forces.push_back({Eigen::VectorXd::Ones(1), -4.0, {}});
  EXPECT_DOUBLE_EQ(energy_scale(model, at_rest()), 0.5 * 16.0 / k);
  model.K.setZero();
  model.contacts[0].clearance = 0.3;
  EXPECT_DOUBLE_EQ(energy_scale(model, at_rest()), 4.0 * 0.3);
}

// The steady motion has the amplitude F / |k - m w^2 + i c w|; above the resonance its largest
// energy is the kinetic energy.
TEST(EnergyScale, OfHarmonicForceEqualsEnergyOfSteadyMotion) {
  Model model = oscillator(k);
  constexpr double F = 3.0, w = 7.0;
  model.forces.push_back({Eigen::VectorXd::Ones(1), 0.0, {F, w, 0.4}});
  const double a = F / std::hypot(k - m * w * w, c * w);
  EXPECT_DOUBLE_EQ(energy_scale(model, at_rest()), 0.5 * m * w * w * a * a);
}

TEST(EnergyScale, IsFiniteAtUndampedResonance) {
  Model model = oscillator(k);
  model.C.setZero();
  model.forces.push_back({Eigen::VectorXd::Ones(1), 0.0, {3.0, 5.0, 0.0}});
  const double a = 3.0 / (0.02 * k);
  EXPECT_DOUBLE_EQ(energy_scale(model, at_rest()), 0.5 * k * a * a);
}

TEST(EnergyScale, OfSupportEqualsEnergyOfItsMotionAndClearance) {
  Model model = oscillator(k);
  model.contacts[0].clearance = 0.2;
  model.contacts[0].motion = {0.01, 30.0, 0.0};
  EXPECT_DOUBLE_EQ(energy_scale(model, at_rest()), 0.5 * m * 0.09 + 0.5 * k * 0.04);
}

}  // namespace
}  // namespace sprag
