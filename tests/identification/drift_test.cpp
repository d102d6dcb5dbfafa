#include "sprag/detail/identification/drift.h"

#include <gtest/gtest.h>

#include <iostream>

#include "sprag/detail/parameters/unknowns.h"
#include "studies/identification/drifting.h"
#include "studies/identification/trial.h"
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
  const auto estimate = estimate_drift(scene, identify(scene, events, settings));
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

}  // namespace
}  // namespace sprag
