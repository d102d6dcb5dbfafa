#include "sprag/detail/mechanics/wide_product.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace sprag {
namespace {

// Equal bit for bit to the sums in their order, for blocks of larger matrices and all remainders of
// the sizes.
TEST(WideProduct, EqualsOrderedSums) {
  Random random(3);
  for (const Eigen::Index m : {1, 7, 8, 9, 16, 23}) {
    for (const Eigen::Index n : {1, 3, 4, 5, 8, 11}) {
      for (const Eigen::Index inner : {0, 1, 12}) {
        SCOPED_TRACE(testing::Message() << m << " x " << inner << " x " << n);
        const Eigen::MatrixXd A = random.matrix(m + 2, inner);
        const Eigen::MatrixXd B = random.matrix(inner + 1, n);
        Eigen::MatrixXd C = random.matrix(m + 3, n + 1);
        Eigen::MatrixXd product = C;
        Eigen::MatrixXd added = C;
        for (Eigen::Index i = 0; i < m; ++i) {
          for (Eigen::Index j = 0; j < n; ++j) {
            double sum = 0.0;
            for (Eigen::Index k = 0; k < inner; ++k) sum += A(i + 2, k) * B(k, j);
            product(i, j) = sum;
            added(i, j) += sum;
          }
        }
        Eigen::MatrixXd D = C;
        multiply(A.bottomRows(m), B.topRows(inner), D.topLeftCorner(m, n));
        EXPECT_EQ(D, product);
        multiply_and_add(A.bottomRows(m), B.topRows(inner), C.topLeftCorner(m, n));
        EXPECT_EQ(C, added);
      }
    }
  }
}

}  // namespace
}  // namespace sprag
