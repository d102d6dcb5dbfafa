#include "sprag/detail/mechanics/wide_product.h"

#include <algorithm>

#include "sprag/detail/mechanics/widest.h"

namespace sprag {
namespace {

using Eigen::Index;

// Block of C that is accumulated in registers, so that each loaded entry of A serves four columns.
constexpr Index rows = 8;
constexpr Index columns = 4;

struct Columns {
  const double* data;
  Index stride;
};

SPRAG_WIDEST void multiply_large(Columns A, Columns B, Index m, Index inner, Index n, bool add,
                                 double* C, Index stride) {
  // The last block of rows, and of columns, overlaps the block before it.
  const auto block = [](Index from, Index end, Index size) { return std::min(from, end - size); };
  for (Index column = 0; column < n; column += columns) {
    const Index j0 = block(column, n, columns);
    Index done_rows = 0;  // rows of these columns that are complete, not to be added to again
    for (Index row = 0; row < m; row += rows) {
      const Index i0 = block(row, m, rows);
      double sum[columns * rows] = {};
      for (Index k = 0; k < inner; ++k) {
        const double* a = A.data + i0 + k * A.stride;
        for (Index j = 0; j < columns; ++j) {
          const double b = B.data[k + (j0 + j) * B.stride];
#pragma GCC unroll 1
          for (Index i = 0; i < rows; ++i) sum[j * rows + i] += a[i] * b;
        }
      }
      for (Index j = std::max(column - j0, Index{0}); j < columns; ++j) {
        double* c = C + (j0 + j) * stride + i0;
        for (Index i = done_rows - i0; i < rows; ++i) {
          c[i] = add ? c[i] + sum[j * rows + i] : sum[j * rows + i];
        }
      }
      done_rows = i0 + rows;
    }
  }
}

bool is_large(const Eigen::Ref<Eigen::MatrixXd>& C) {
  return C.rows() >= rows && C.cols() >= columns;
}

void multiply_large(const Eigen::Ref<const Eigen::MatrixXd>& A,
                    const Eigen::Ref<const Eigen::MatrixXd>& B, bool add,
                    Eigen::Ref<Eigen::MatrixXd>& C) {
  multiply_large({A.data(), A.outerStride()}, {B.data(), B.outerStride()}, C.rows(), A.cols(),
                 C.cols(), add, C.data(), C.outerStride());
}

}  // namespace

void multiply(const Eigen::Ref<const Eigen::MatrixXd>& A,
              const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C) {
  if (is_large(C)) {
    multiply_large(A, B, false, C);
  } else {
    C.noalias() = A.lazyProduct(B);
  }
}

void multiply_and_add(const Eigen::Ref<const Eigen::MatrixXd>& A,
                      const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C) {
  if (is_large(C)) {
    multiply_large(A, B, true, C);
  } else {
    C.noalias() += A.lazyProduct(B);
  }
}

}  // namespace sprag
