// Would catch a vectorized product with sums in another order.
#include "sprag/detail/mechanics/wide_product.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace sprag {
namespace {

// Equal bit for bit to the sums in their order, for blocks of larger matrices and all remainders of
// the sizes.
TEST(WideProduct, EqualsOrderedSums) {
  Random random(3);
  for (const Eigen::Index rows : {1, 7, 8, 9, 16, 23}) {
    for (const Eigen::Index n : {1, 3, 4, 5, 8, 11}) {
      for (const Eigen::Index inner : {0, 1, 12}) {
        SCOPED_TRACE(testing::Message() << rows << " x " << inner << " x " << n);
        const Eigen::MatrixXd A = random.matrix(rows + 2, inner);
        const Eigen::MatrixXd B = random.matrix(inner + 1, n);
        Eigen::MatrixXd C = random.matrix(rows + 3, n + 1);
        Eigen::MatrixXd product = C;
        Eigen::MatrixXd added = C;
        for (Eigen::Index i = 0; i < rows; ++i) {
          for (Eigen::Index j = 0; j < n; ++j) {
            double sum = 0.0;
            for (Eigen::Index l = 0; l < inner; ++l) sum += A(i + 2, l) * B(l, j);
            product(i, j) = sum;
            added(i, j) += sum;
          }
        }
        Eigen::MatrixXd D = C;
        multiply(A.bottomRows(rows), B.topRows(inner), D.topLeftCorner(rows, n));
        EXPECT_EQ(D, product);
        multiply_and_add(A.bottomRows(rows), B.topRows(inner), C.topLeftCorner(rows, n));
        EXPECT_EQ(C, added);
      }
    }
  }
}

}  // namespace
}  // namespace sprag
