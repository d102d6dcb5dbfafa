#include "sprag/detail/identification/restitution_trend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "sprag/detail/identification/drift.h"
#include "studies/common/random.h"
#include "tests/identification/ball.h"

namespace sprag {
namespace {

// Impacts with epsilon(v) = epsilon + trend v, in closed form.
std::vector<ContactEvent> bounces(double epsilon, double trend, double jitter, std::uint64_t seed) {
  common::Random draw(seed);
  std::vector<ContactEvent> events;
  double t = 0.1, v = 3.0;
  for (int k = 0; k < 30; ++k) {
    events.push_back({t + jitter * draw.normal(), 0, ContactEventKind::pulse});
    v *= epsilon + trend * v;
    t += 2.0 * v / 9.81;
  }
  return events;
}

struct Found {
  std::optional<RestitutionTrend> trend;
  std::optional<DriftEstimate> drift;
};

Found found_of(double trend, std::optional<double> given, int seed) {
  constexpr double jitter = 1e-5;
  const Scene scene =
      test::ball("0.0", "law = \"newton\"\nrestitution = 0.92", "[master]\nu = [3.0]\n[replica]\n");
  IdentificationSettings settings;
  settings.unknowns = {unknown_of(scene, "impact.restitution")};
  settings.jitter = given;
  const auto events = bounces(0.9, trend, jitter, static_cast<std::uint64_t>(seed));
  const Identification fit = identify(scene, events, settings);
  Found found{estimate_restitution_trend(scene, fit), estimate_drift(scene, fit)};
  if (found.trend && found.drift) {
    std::cout << "seed " << seed << ", trend " << trend << ": " << found.trend->trend << " +- "
              << found.trend->sigma << ", chi^2 " << found.trend->chi2_without << " to "
              << found.trend->chi2_with << ", gain " << found.trend->gain << "; of a drift "
              << found.drift->gain << '\n';
  }
  return found;
}

TEST(RestitutionTrend, IsEstimatedAtCorrectSize) {
  constexpr double trend = -3e-4;
  for (int seed = 1; seed <= 5; ++seed) {
    for (const std::optional<double> given : {std::optional<double>(), std::optional(1e-5)}) {
      const Found of = found_of(trend, given, seed);
      ASSERT_TRUE(of.trend);
      EXPECT_TRUE(of.trend->found());
      // The trend is not mistaken for a drift.
      ASSERT_TRUE(of.drift);
      EXPECT_GT(of.trend->gain, of.drift->gain);
      EXPECT_NEAR(of.trend->trend, trend, 4.0 * of.trend->sigma);
      EXPECT_LT(of.trend->sigma, 0.1 * std::abs(trend));
      EXPECT_LT(of.trend->chi2_with, 0.5 * of.trend->chi2_without);
    }
  }
}

TEST(RestitutionTrend, IsZeroForConstantRestitution) {
  for (int seed = 1; seed <= 5; ++seed) {
    for (const std::optional<double> given : {std::optional<double>(), std::optional(1e-5)}) {
      const Found of = found_of(0.0, given, seed);
      ASSERT_TRUE(of.trend);
      EXPECT_FALSE(of.trend->found());
      ASSERT_TRUE(of.drift);
      EXPECT_FALSE(of.drift->found());
      EXPECT_LT(std::abs(of.trend->trend), 4.0 * of.trend->sigma);
    }
  }
}

}  // namespace
}  // namespace sprag
