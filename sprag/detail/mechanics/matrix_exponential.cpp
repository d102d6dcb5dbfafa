#include "sprag/detail/mechanics/matrix_exponential.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {
namespace {

// 1 / k!. The remainder of the series is below rounding for matrices of this norm.
constexpr int taylor_degree = 16;
constexpr double largest_norm = 0.75;
constexpr std::array<double, taylor_degree + 1> taylor_coefficients = [] {
  std::array<double, taylor_degree + 1> of{1.0};
  for (std::size_t k = 1; k < of.size(); ++k) of[k] = of[k - 1] / static_cast<double>(k);
  return of;
}();

}  // namespace

MatrixExponential::MatrixExponential(Eigen::Index size) {
  for (Eigen::MatrixXd* of : {&power_, &square_, &cube_, &fourth_, &sum_}) of->resize(size, size);
}

void MatrixExponential::apply(Eigen::Ref<Eigen::MatrixXd> A) {
  const Eigen::Index n = A.rows();
  const double norm = A.cwiseAbs().rowwise().sum().maxCoeff();
  const int halvings = norm > largest_norm ? std::ilogb(norm / largest_norm) + 1 : 0;
  A *= std::ldexp(1.0, -halvings);
  auto A2 = square_.topLeftCorner(n, n), A3 = cube_.topLeftCorner(n, n),
       A4 = fourth_.topLeftCorner(n, n), next = power_.topLeftCorner(n, n),
       sum = sum_.topLeftCorner(n, n);
  multiply(A, A, A2);
  multiply(A2, A, A3);
  multiply(A2, A2, A4);
  // Horner's rule in A^4 (Paterson & Stockmeyer 1973).
  sum.setZero();
  sum.diagonal().setConstant(taylor_coefficients[taylor_degree]);
  for (std::size_t k = taylor_degree - 4;; k -= 4) {
    multiply(sum, A4, next);
    sum = next + taylor_coefficients[k + 1] * A + taylor_coefficients[k + 2] * A2 +
          taylor_coefficients[k + 3] * A3;
    sum.diagonal().array() += taylor_coefficients[k];
    if (k == 0) break;
  }
  for (int i = 0; i < halvings; ++i) {
    multiply(sum, sum, next);
    sum = next;
  }
  A = sum;
}

}  // namespace sprag
