// Would catch a replayed message that is accepted, and a clock set wrongly for once that blocks all
// later messages.
#include "lcmtypes/freshness.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace sprag {
namespace {

constexpr std::int64_t second = 1'000'000;
constexpr std::int64_t now = 1'700'000'000 * second;
constexpr std::int64_t year = 365 * 86400 * second;

TEST(FreshnessTest, OldMessageIsRefused) {
  const FreshnessRule freshness(Freshness::required);
  EXPECT_TRUE(freshness.allows(now, now));
  EXPECT_TRUE(freshness.allows(now - 10 * second, now));
  EXPECT_TRUE(freshness.allows(now + 10 * second, now));
  EXPECT_FALSE(freshness.allows(now - 11 * second, now));
  EXPECT_FALSE(freshness.allows(now + 11 * second, now));
  EXPECT_FALSE(freshness.allows(0, now));
  EXPECT_FALSE(freshness.allows(INT64_MIN, now));
  EXPECT_FALSE(freshness.allows(INT64_MAX, now));
  EXPECT_TRUE(FreshnessRule(Freshness::any).allows(0, now));
}

TEST(FreshnessTest, MessageMustBeLaterThanReceivedOnes) {
  FreshnessRule freshness(Freshness::required);
  freshness.note(now);
  freshness.note(now - second);
  EXPECT_FALSE(freshness.allows(now - 1, now + second));
  EXPECT_TRUE(freshness.allows(now + 1, now + second));
}

TEST(FreshnessTest, ClockOnceAYearAheadDoesNotBlockMessages) {
  FreshnessRule freshness(Freshness::required);
  freshness.note(now + year);
  EXPECT_TRUE(freshness.allows(now, now));
  EXPECT_FALSE(freshness.allows(now - 11 * second, now));
}

}  // namespace
}  // namespace sprag
