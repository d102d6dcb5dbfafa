#include "sprag/detail/identification/restitution_trend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "sprag/detail/identification/drift.h"
#include "sprag/detail/parameters/unknowns.h"
#include "studies/common/random.h"
#include "tests/identification/ball.h"

namespace sprag {
namespace {

// Impacts with epsilon(v) = epsilon + trend v, in closed form.
std::vector<ContactEvent> bounces(double epsilon, double trend, double jitter, std::uint64_t seed,
                                  double scatter = 0.0) {
  common::Random draw(seed);
  std::vector<ContactEvent> events;
  double t = 0.1, v = 3.0;
  for (int k = 0; k < 30; ++k) {
    events.push_back({t + jitter * draw.normal(), 0, ContactEventKind::pulse});
    v *= epsilon + trend * v + (scatter > 0.0 ? scatter * draw.normal() : 0.0);
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

// The deviation of a trend includes the scatter of the restitution that the same run reports.
TEST(RestitutionTrend, IsZeroBesideAScatteringRestitution) {
  constexpr double jitter = 1e-4, scatter = 3e-3;
  const Scene scene =
      test::ball("0.0", "law = \"newton\"\nrestitution = 0.92", "[master]\nu = [3.0]\n[replica]\n");
  IdentificationSettings settings;
  settings.unknowns = {unknown_of(scene, "impact.restitution")};
  int scatters = 0, apart = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Identification fit = identify(scene, bounces(0.9, 0.0, jitter, seed, scatter), settings);
    const Departure& departure = fit.departure;
    if (!departure.is_scatter()) continue;
    ++scatters;
    ASSERT_TRUE(departure.trend && departure.trend_beside);
    const RestitutionTrend &alone = *departure.trend, &beside = *departure.trend_beside;
    std::cout << "seed " << seed << ": " << beside.trend << " +- " << beside.sigma
              << ", without the scatter " << alone.trend << " +- " << alone.sigma << '\n';
    EXPECT_LT(std::abs(beside.trend), 4.0 * beside.sigma) << "seed " << seed;
    EXPECT_FALSE(beside.found()) << "seed " << seed;
    apart += std::abs(alone.trend) > 4.0 * alone.sigma ? 1 : 0;
  }
  EXPECT_GE(scatters, 7);
  EXPECT_GT(apart, 0);  // the records show the difference
}

}  // namespace
}  // namespace sprag
