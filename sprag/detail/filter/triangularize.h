// Orthogonal factorization of a matrix whose columns are a square root of a covariance.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/filter/filter_belief.h"

namespace sprag {

/// Makes rows first to end - 1 of A lower triangular, row `first` with its diagonal in column 0, by
/// Householder reflections of the first `columns` columns. A A^T of these rows does not change;
/// other rows are not touched. `scratch` has at least `columns` entries. Does not allocate.
void triangularize(FilterBelief::Rows& A, Eigen::Index first, Eigen::Index end,
                   Eigen::Index columns, Eigen::VectorXd& scratch);

}  // namespace sprag
