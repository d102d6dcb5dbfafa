#include "lcmtypes/freshness.h"

#include <gtest/gtest.h>

namespace sprag {
namespace {

constexpr std::int64_t second = 1'000'000;
constexpr std::int64_t now = 1'700'000'000 * second;
constexpr std::int64_t year = 365 * 86400 * second;

TEST(FreshnessTest, AMessageMustHaveBeenSentJustNow) {
  const Freshness freshness;
  EXPECT_TRUE(freshness.fresh(now, now));
  EXPECT_TRUE(freshness.fresh(now - 10 * second, now));
  EXPECT_TRUE(freshness.fresh(now + 10 * second, now));
  EXPECT_FALSE(freshness.fresh(now - 11 * second, now));
  EXPECT_FALSE(freshness.fresh(now + 11 * second, now));
  EXPECT_FALSE(freshness.fresh(0, now));
  EXPECT_FALSE(freshness.fresh(INT64_MIN, now));
  EXPECT_FALSE(freshness.fresh(INT64_MAX, now));
}

TEST(FreshnessTest, AMessageMustBeLaterThanWhatWasHeard) {
  Freshness freshness;
  freshness.note(now);
  freshness.note(now - second);
  EXPECT_FALSE(freshness.fresh(now - 1, now + second));
  EXPECT_TRUE(freshness.fresh(now + 1, now + second));
}

TEST(FreshnessTest, AClockThatWasAYearAheadDoesNoHarm) {
  Freshness freshness;
  freshness.note(now + year);
  EXPECT_TRUE(freshness.fresh(now, now));
  EXPECT_FALSE(freshness.fresh(now - 11 * second, now));
}

}  // namespace
}  // namespace sprag
