// Departures from the model besides the jitter: would catch a drift, a scatter or a trend of the
// restitution that is missed, mistaken for another, or found where there is none.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "sprag/detail/parameters/scene_parameters.h"
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
  settings.unknowns = parameters_named(scene, identification_study::usual_keys(scene));
  for (Parameter& unknown : settings.unknowns) unknown.within = 0.05;
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

// The slower scene only in a thorough run.
std::vector<const char*> scenes_of_drift() {
  return thorough() ? std::vector{"paper_beam", "non_proportional"} : std::vector{"paper_beam"};
}

constexpr double jitter_of_drift = 1e-4;
const std::optional<double> given_jitters[] = {{}, jitter_of_drift};

TEST(Drift, IsEstimatedAtCorrectSize) {
  constexpr double drift = 1e-8;
  for (const char* name : scenes_of_drift()) {
    for (const std::optional<double> given : given_jitters) {
      const auto found = drift_of(name, drift, jitter_of_drift, given, 1);
      ASSERT_TRUE(found);
      EXPECT_TRUE(found->found());
      EXPECT_GT(found->drift, drift / 3.0);
      EXPECT_LT(found->drift, 3.0 * drift);
      EXPECT_LT(found->low, found->drift);
      EXPECT_GT(found->high, found->drift);
      EXPECT_NEAR(found->jitter, jitter_of_drift, 0.4 * jitter_of_drift);
    }
  }
}

TEST(Drift, IsZeroForCorrectModel) {
  for (const char* name : scenes_of_drift()) {
    for (const std::optional<double> given : given_jitters) {
      const auto none = drift_of(name, 0.0, jitter_of_drift, given, 1);
      ASSERT_TRUE(none);
      EXPECT_FALSE(none->found());
      EXPECT_EQ(none->low, 0.0);
      EXPECT_GT(none->high, 0.0);
      EXPECT_LT(none->high, 1e-8);
    }
    const auto exact = drift_of(name, 0.0, 0.0, {}, 1);
    ASSERT_TRUE(exact);
    EXPECT_EQ(exact->drift, 0.0);
  }
}

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

Scene bouncing_ball() {
  return test::ball("0.0", "law = \"newton\"\nrestitution = 0.92",
                    "[master]\nu = [3.0]\n[replica]\n");
}

// A trend is estimated at its size and not mistaken for a drift; there is none without it.
TEST(RestitutionTrend, IsEstimatedAtCorrectSize) {
  constexpr double jitter = 1e-5;
  const Scene scene = bouncing_ball();
  IdentificationSettings settings;
  settings.unknowns = {parameter_of(scene, "impact.restitution")};
  for (const double trend : {-3e-4, 0.0}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      for (const std::optional<double> given : {std::optional<double>(), std::optional(jitter)}) {
        SCOPED_TRACE(testing::Message() << "trend " << trend << ", seed " << seed);
        settings.jitter = given;
        const Departure of = identify(scene, bounces(0.9, trend, jitter, seed), settings).departure;
        ASSERT_TRUE(of.trend && of.drift);
        EXPECT_EQ(of.trend->found(), trend != 0.0);
        EXPECT_NEAR(of.trend->trend, trend, 4.0 * of.trend->sigma);
        if (trend == 0.0) {
          EXPECT_FALSE(of.drift->found());
          continue;
        }
        EXPECT_GT(of.trend->gain, of.drift->gain);
        EXPECT_LT(of.trend->sigma, 0.1 * std::abs(trend));
        EXPECT_LT(of.trend->chi2_with, 0.5 * of.trend->chi2_without);
      }
    }
  }
}

// The deviations of the restitution and of a trend include the scatter that the same run reports.
TEST(RestitutionTrend, IsZeroBesideAScatteringRestitution) {
  constexpr double jitter = 1e-4, scatter = 3e-3;
  const Scene scene = bouncing_ball();
  IdentificationSettings settings;
  settings.unknowns = {parameter_of(scene, "impact.restitution")};
  int scatters = 0;
  double squares = 0.0;
  int values = 0;
  const int runs = repetitions(24);
  for (int seed = 1; seed <= runs; ++seed) {
    const Identification fit = identify(
        scene, bounces(0.9, 0.0, jitter, static_cast<std::uint64_t>(seed), scatter), settings);
    if (!fit.fits()) continue;  // it claims nothing
    ++values;
    const double off = (fit.unknowns[0].value - 0.9) / fit.unknowns[0].sigma;
    EXPECT_LT(std::abs(off), 5.0) << "seed " << seed;
    squares += off * off;
    const Departure& departure = fit.departure;
    if (!departure.is_scatter()) continue;
    ++scatters;
    ASSERT_TRUE(departure.trend);
    EXPECT_LT(std::abs(departure.trend->trend), 4.0 * departure.trend->sigma) << "seed " << seed;
    EXPECT_FALSE(departure.trend->found()) << "seed " << seed;
  }
  std::cout << values << " of " << runs << " fit, " << scatters << " with scatter, mean square "
            << squares / values << '\n';
  if (sanitized) return;
  EXPECT_GE(values, runs * 9 / 10);
  EXPECT_GE(scatters, runs * 7 / 10);
  EXPECT_LT(squares, 2.0 * values);
  EXPECT_GT(squares, 0.2 * values);
}

}  // namespace
}  // namespace sprag
