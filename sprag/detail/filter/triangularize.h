// Orthogonal factorization of a matrix whose columns are a square root of a covariance.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/filter/filter_belief.h"

namespace sprag {

/// Rows first to end - 1 of A become lower triangular, the first of them in column 0, by
/// Householder reflections of the columns: A A^T of the rows from `first` on stays. `scratch` has
/// as many entries as A columns. Does not allocate.
void triangularize(FilterBelief::Rows& A, Eigen::Index first, Eigen::Index end,
                   Eigen::Index columns, Eigen::VectorXd& scratch);

}  // namespace sprag
