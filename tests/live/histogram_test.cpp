#include "sprag/detail/live/histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/random.h"

namespace sprag {
namespace {

TEST(Histogram, QuantilesExceedTrueOnesByAtMostOneBucket) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Histogram histogram;
    std::vector<std::int64_t> values;
    for (int i = 0; i < 2000; ++i) {
      values.push_back(static_cast<std::int64_t>(random.log_uniform(0.5, 1e15)));
      histogram.add(values.back());
    }
    std::sort(values.begin(), values.end());
    for (const double p : {0.01, 0.5, 0.99, 0.999, 1.0}) {
      const auto rank = static_cast<std::size_t>(std::ceil(p * 2000.0)) - 1;
      const auto truth = static_cast<double>(values[rank]);
      const auto shown = static_cast<double>(histogram.quantile(p));
      EXPECT_GE(shown, truth) << p;
      EXPECT_LE(shown, truth * (1.0 + 1.0 / 16)) << p;
    }
    EXPECT_EQ(histogram.quantile(1.0), values.back());
    EXPECT_EQ(histogram.largest(), values.back());
    EXPECT_EQ(histogram.count(), 2000);
  }
}

TEST(Histogram, CountsValuesAboveTheBucketOfOne) {
  Histogram histogram;
  for (const std::int64_t value : {0, 3, 4, 1000, 1'000'000, 20'000'000}) histogram.add(value);
  EXPECT_EQ(histogram.count_above(0), 5);
  EXPECT_EQ(histogram.count_above(3), 4);
  EXPECT_EQ(histogram.count_above(10'000'000), 1);
  EXPECT_EQ(histogram.count_above(20'000'000), 0);
  EXPECT_EQ(histogram.count_above(std::numeric_limits<std::int64_t>::max()), 0);
}

TEST(Histogram, SmallValuesAreExactAndTheLargestHasABucket) {
  for (std::int64_t value = 0; value < 32; ++value) {
    Histogram histogram;
    histogram.add(value);
    histogram.add(1000);
    EXPECT_EQ(histogram.quantile(0.5), value);
  }
  Histogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0);
  histogram.add(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(histogram.quantile(0.5), std::numeric_limits<std::int64_t>::max());
  Histogram negative;
  negative.add(-5);
  EXPECT_EQ(negative.quantile(1.0), 0);
}

}  // namespace
}  // namespace sprag
