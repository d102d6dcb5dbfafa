// Each failing variant fails, and Sprag does not fail in the same case.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "studies/stability/failures.h"

namespace sprag::stability {
namespace {

double value_at(const Curve& curve, double x) {
  const auto after = std::lower_bound(curve.x.begin(), curve.x.end(), x - 1e-9);
  return curve.y[static_cast<std::size_t>(after - curve.x.begin())];
}

double largest(const Curve& curve) { return *std::max_element(curve.y.begin(), curve.y.end()); }

double largest_growth(const Curve& curve) {
  double growth = 0.0;
  for (std::size_t i = 1; i < curve.y.size(); ++i) {
    growth = std::max(growth, curve.y[i] - curve.y[i - 1]);
  }
  return growth;
}

TEST(Stability, NewtonLawGivesClosedClutchNegativeVelocity) {
  const auto curves = newton_after_a_closed_clutch();
  EXPECT_NEAR(curves[0].y.back(), -0.21, 1e-15);
  EXPECT_EQ(curves[1].y.back(), 0.0);
}

// The criterion predicts the range: 13 of 20 differences, up to the one at which D G + G D becomes
// indefinite.
TEST(Stability, UnlikeRestitutionLetsVGrowBeyondTheCriterion) {
  const auto curves = unlike_restitution(20000);
  int beyond = 0;
  for (std::size_t i = 0; i < curves[0].x.size(); ++i) {
    if (newton_criterion(curves[0].x[i]) >= 0.0) {
      EXPECT_LE(curves[0].y[i], 1.0 + 1e-9) << "difference " << curves[0].x[i];
    } else if (curves[0].y[i] > 1.0 + 1e-6) {
      ++beyond;
    }
  }
  EXPECT_GT(beyond, 5);
  EXPECT_LE(curves[1].y[0], 1.0 + 1e-9);
  EXPECT_GT(largest(curves[1]), 1.01) << "Poisson can, too";
}

TEST(Stability, WithoutDampingNothingConverges) {
  const auto curves = no_damping(100.0);
  EXPECT_GT(curves[0].y.back(), 0.2 * curves[0].y.front());
  EXPECT_LT(curves[1].y.back(), 1e-7 * curves[1].y.front());
  for (const Curve& curve : curves) EXPECT_LE(largest_growth(curve), 1e-13 * curve.y.front());
}

TEST(Stability, SustainedContactStallsVUntilReleased) {
  const auto curves = persistent_contact(90.0);
  const Curve& V = curves[0];
  const Curve& remainder = curves[1];
  // The clutch has locked: the remainder is constant, and V exceeds it by the energy of the
  // remaining oscillation.
  EXPECT_NEAR(value_at(remainder, 15.0), value_at(remainder, 28.0), 1e-12);
  EXPECT_GT(value_at(V, 28.0), value_at(remainder, 28.0));
  EXPECT_LT(value_at(V, 28.0) - value_at(remainder, 28.0), 0.1 * value_at(V, 28.0));
  EXPECT_LT(value_at(V, 90.0), 1e-4 * value_at(remainder, 28.0));
  EXPECT_LE(largest_growth(V), 1e-13 * V.y.front());
}

TEST(Stability, ChatterIsCompletedUnlikeInPlainLoop) {
  const auto curves = event_storm(5000);
  EXPECT_EQ(curves[0].y.back(), 5000.0);
  const double accumulation = std::sqrt(2.0 / 9.81) * 1.7 / 0.3;
  EXPECT_LE(curves[0].x.back(), accumulation + 1e-12);
  EXPECT_EQ(curves[1].x.back(), 3.0);
  EXPECT_LT(curves[1].y.back(), 100.0);
}

TEST(Stability, ASignCheckMissesTouchesThatTheSearchFinds) {
  const auto curves = missed_touches(2000);
  EXPECT_GT(curves[0].y.front(), 0.3);
  EXPECT_GT(curves[0].y.back(), curves[0].y.front());
  EXPECT_EQ(largest(curves[1]), 0.0);
}

TEST(Stability, ActivationByTheGapAloneGainsEnergy) {
  const auto curves = gap_activation();
  EXPECT_GT(largest(curves[0]), 1e-3);
  EXPECT_LE(largest(curves[1]), 0.0);
}

TEST(Stability, StepsBeyondTheirLimitDiverge) {
  const auto curves = step_limits();
  EXPECT_GT(curves[0].y.back(), 20.0) << "explicit Euler";
  EXPECT_GT(curves[1].y.back(), 5.0) << "theta = 0.4";
  EXPECT_NEAR(curves[2].y.back(), 0.0, 1e-12) << "theta = 1/2";
  EXPECT_NEAR(curves[3].y.back(), 0.0, 1e-12) << "exact flow";
}

}  // namespace
}  // namespace sprag::stability
