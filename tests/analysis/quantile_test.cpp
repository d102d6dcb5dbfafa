// Quantiles of samples.
#include "sprag/detail/analysis/quantile.h"

#include <gtest/gtest.h>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

TEST(Quantiles, InterpolateLinearly) {
  EXPECT_EQ(quantile({3.0}, 0.95), 3.0);
  EXPECT_EQ(quantile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 0.5), 2.5);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 0.0), 1.0);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 1.0), 4.0);
  EXPECT_EQ(quantile({infinity, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(quantile({infinity, infinity, 2.0}, 0.75), infinity);
}

}  // namespace
}  // namespace sprag
