#include "sprag/detail/filter/triangularize.h"

#include <limits>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

void triangularize(FilterBelief::Rows& A, Eigen::Index first, Eigen::Index end,
                   Eigen::Index columns, Eigen::VectorXd& scratch) {
  for (Eigen::Index i = 0; i < end - first; ++i) {
    const Eigen::Index length = columns - i;
    auto row = A.row(first + i).segment(i, length);
    const double norm = row.norm();
    if (!(square(norm) > std::numeric_limits<double>::min())) {
      row.setZero();
      continue;
    }
    auto v = scratch.head(length);
    v = row.transpose();
    const double head = v[0] > 0.0 ? -norm : norm;
    v[0] -= head;
    const double scale = 2.0 / v.squaredNorm();
    row.setZero();
    row[0] = head;
    for (Eigen::Index k = first + i + 1; k < end; ++k) {
      auto below = A.row(k).segment(i, length);
      const double share = scale * below.dot(v);
      below -= share * v.transpose();
    }
  }
}

}  // namespace sprag
