// Departures from the model besides the jitter: would catch a drift, a scatter or a trend of the
// restitution that is missed, mistaken for another, or found where there is none.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/identification.h"
#include "studies/common/random.h"
#include "studies/identification/drifting.h"
#include "studies/identification/records.h"
#include "tests/identification/ball.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using identification_study::drifting_events;
using test::shipped_scene;

std::optional<DriftEstimate> drift_of(const char* name, double drift, double jitter,
                                      std::optional<double> given, std::uint64_t seed) {
  constexpr double end = 60.0, push = 0.05;
  const Scene scene = shipped_scene(name);
  IdentificationSettings settings;
  settings.unknowns = unknowns_named(scene, identification_study::usual_keys(scene));
  for (Unknown& unknown : settings.unknowns) unknown.within = 0.05;
  settings.jitter = given;
  settings.mend = false;
  const auto events = drifting_events(scene, drift, jitter, end, push, seed);
  const auto estimate = identify(scene, events, settings).departure.drift;
  if (estimate) {
    std::cout << name << ", seed " << seed << ", drift " << drift << ": " << estimate->drift << " ("
              << estimate->low << " to " << estimate->high << "), gain " << estimate->gain
              << ", jitter " << estimate->jitter << '\n';
  }
  return estimate;
}

class DriftOfScenes : public testing::TestWithParam<const char*> {};

TEST_P(DriftOfScenes, IsEstimatedAtCorrectSize) {
  constexpr double drift = 1e-8, jitter = 1e-4;
  for (int seed = 1; seed <= std::max(1, long_repetitions(3)); ++seed) {
    for (const std::optional<double> given : {std::optional<double>(), std::optional(jitter)}) {
      const auto found =
          drift_of(GetParam(), drift, jitter, given, static_cast<std::uint64_t>(seed));
      ASSERT_TRUE(found);
      EXPECT_TRUE(found->found());
      EXPECT_GT(found->drift, drift / 3.0);
      EXPECT_LT(found->drift, 3.0 * drift);
      EXPECT_LT(found->low, found->drift);
      EXPECT_GT(found->high, found->drift);
      EXPECT_NEAR(found->jitter, jitter, 0.4 * jitter);
    }
  }
}

TEST_P(DriftOfScenes, IsZeroForCorrectModel) {
  constexpr double jitter = 1e-4;
  for (int seed = 1; seed <= std::max(1, long_repetitions(3)); ++seed) {
    for (const std::optional<double> given : {std::optional<double>(), std::optional(jitter)}) {
      const auto none = drift_of(GetParam(), 0.0, jitter, given, static_cast<std::uint64_t>(seed));
      ASSERT_TRUE(none);
      EXPECT_FALSE(none->found());
      EXPECT_EQ(none->low, 0.0);
      EXPECT_GT(none->high, 0.0);
      EXPECT_LT(none->high, 1e-8);
    }
  }
  const auto exact = drift_of(GetParam(), 0.0, 0.0, {}, 1);
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->drift, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, DriftOfScenes, testing::Values("paper_beam", "non_proportional"));

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
  Found found{fit.departure.trend, fit.departure.drift};
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
  int scatters = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Identification fit = identify(scene, bounces(0.9, 0.0, jitter, seed, scatter), settings);
    const Departure& departure = fit.departure;
    if (!departure.is_scatter()) continue;
    ++scatters;
    ASSERT_TRUE(departure.trend);
    const RestitutionTrend& beside = *departure.trend;
    std::cout << "seed " << seed << ": " << beside.trend << " +- " << beside.sigma << '\n';
    EXPECT_LT(std::abs(beside.trend), 4.0 * beside.sigma) << "seed " << seed;
    EXPECT_FALSE(beside.found()) << "seed " << seed;
  }
  EXPECT_GE(scatters, 7);
}

}  // namespace
}  // namespace sprag
