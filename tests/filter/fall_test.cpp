// Would catch a search for the latest fall below zero that returns another root or none.
#include "sprag/detail/filter/fall.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sprag {
namespace {

constexpr double pi = std::numbers::pi;

// A parabola that is negative between its roots.
constexpr auto parabola(double root, double next) {
  return [=](double t) { return (t - root) * (t - next); };
}

TEST(Fall, IsNoneOfAPositiveSignal) { EXPECT_FALSE(latest_fall(0.0, 1.0, parabola(1.5, 2.0))); }

TEST(Fall, IsTheRootBeforeANegativeEnd) {
  const auto fall = latest_fall(0.0, 1.0, parabola(0.3, 2.0));
  ASSERT_TRUE(fall);
  EXPECT_NEAR(fall->t, 0.3, 1e-12);
  EXPECT_EQ(fall->lowest_at, 1.0);
  EXPECT_DOUBLE_EQ(fall->lowest, -0.7);
}

TEST(Fall, IsFoundWhereTheSignalHasRisenAgain) {
  const auto fall = latest_fall(0.0, 1.0, parabola(0.3, 0.8));
  ASSERT_TRUE(fall);
  EXPECT_NEAR(fall->t, 0.3, 1e-12);
  EXPECT_NEAR(fall->lowest_at, 0.55, 1.0 / 32.0);
  EXPECT_NEAR(fall->lowest, -0.0625, 1e-3);
}

TEST(Fall, IsTheLatestOfSeveral) {
  const auto fall = latest_fall(0.0, 5.0 * pi, [](double t) { return std::sin(t); });
  ASSERT_TRUE(fall);
  EXPECT_NEAR(fall->t, 3.0 * pi, 1e-11);
}

TEST(Fall, IsTheBeginningIfTheSignalWasNegativeFromThereOn) {
  for (const double root : {-1.0, 0.0}) {
    const auto fall = latest_fall(0.0, 1.0, parabola(root, 2.0));
    ASSERT_TRUE(fall);
    EXPECT_EQ(fall->t, 0.0);
  }
}

}  // namespace
}  // namespace sprag
