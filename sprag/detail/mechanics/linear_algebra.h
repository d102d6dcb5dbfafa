// Dense products and factorizations, in double and in extended precision. The functions take
// matrices, not expressions: otherwise every translation unit and every expression type would
// compile Eigen's kernels and solvers again.
#pragma once

#include <Eigen/Core>
#include <complex>

namespace sprag {

using Extended = long double;
using MatrixR = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;
using VectorR = Eigen::Matrix<Extended, Eigen::Dynamic, 1>;
using MatrixCR = Eigen::Matrix<std::complex<Extended>, Eigen::Dynamic, Eigen::Dynamic>;
using VectorCR = Eigen::Matrix<std::complex<Extended>, Eigen::Dynamic, 1>;

/// A B with matching inner sizes. A diagonal A takes less time in extended precision.
Eigen::MatrixXd product(const Eigen::Ref<const Eigen::MatrixXd>& A,
                        const Eigen::Ref<const Eigen::MatrixXd>& B);
MatrixR product(const Eigen::Ref<const MatrixR>& A, const Eigen::Ref<const MatrixR>& B);
MatrixCR complex_product(const MatrixR& A, const MatrixCR& B);

/// B^T A B.
Eigen::MatrixXd congruent(const Eigen::Ref<const Eigen::MatrixXd>& B,
                          const Eigen::Ref<const Eigen::MatrixXd>& A);
MatrixR congruent(const Eigen::Ref<const MatrixR>& B, const Eigen::Ref<const MatrixR>& A);

/// Whether the off-diagonal entries are rounding.
bool is_nearly_diagonal(const Eigen::MatrixXd& A);

/// Inverse of a regular A, n x n.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);
MatrixR inverse(const MatrixR& A);

/// A^-1 B, and an estimate of 1 / (|A| |A^-1|) in the norm of absolute column sums.
struct Solution {
  MatrixR X;
  Extended rcond;
};
Solution solve(const MatrixR& A, const MatrixR& B);
/// A^-1 B for complex A and B, as a real system of twice the size.
MatrixCR solve(const MatrixCR& A, const MatrixCR& B);

/// Replaces the lower triangle of M by L with M = L L^T, and returns whether M is positive
/// definite. M n x n and symmetric; its lower triangle is read. Does not allocate.
bool factorize(Eigen::Ref<Eigen::MatrixXd> M);

/// M = L L^T, L lower triangular. M n x n and symmetric; its lower triangle is read.
class CholeskyFactor {
 public:
  explicit CholeskyFactor(const Eigen::MatrixXd& M);
  /// Whether M is positive definite. The other members are valid only then.
  bool exists() const { return exists_; }
  /// n x n.
  const Eigen::MatrixXd& L() const { return L_; }
  /// M^-1 B and L^-1 B, n rows each.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& B) const;
  Eigen::MatrixXd solve_L(const Eigen::MatrixXd& B) const;

 private:
  Eigen::MatrixXd L_;
  bool exists_ = false;
};

/// L of a positive definite M as above, and M^-1 B, in extended precision.
MatrixR cholesky_factor(const MatrixR& M);
MatrixR solve_definite(const MatrixR& M, const MatrixR& B);

/// A = Q R for A m x n: Q orthogonal, m x m; R upper triangular with min(m, n) rows.
class QR {
 public:
  explicit QR(const Eigen::MatrixXd& A);
  Eigen::MatrixXd R() const;
  /// Q B and, for m >= n, R^-T B; B with m and n rows.
  Eigen::MatrixXd Q_times(Eigen::MatrixXd B) const;
  Eigen::MatrixXd solve_R_transposed(const Eigen::MatrixXd& B) const;

 private:
  Eigen::MatrixXd reflections_;  // R above the Householder vectors
  Eigen::VectorXd coefficients_;
};

/// A P = Q R for A m x n, with column pivoting: columns in the order of their remaining norm. The
/// rank is the number of pivots above `threshold` times the largest. Solves least squares with
/// dependent columns.
class PivotedQR {
 public:
  PivotedQR() = default;
  PivotedQR(const Eigen::MatrixXd& A, double threshold);
  Eigen::Index rank() const { return rank_; }
  /// Q B, Q^T B; m rows.
  Eigen::MatrixXd Q_times(Eigen::MatrixXd B) const;
  Eigen::MatrixXd Q_transposed_times(Eigen::MatrixXd B) const;
  /// X that minimizes |A X - B|, with zero rows for the columns of A beyond the rank. solve_rotated
  /// takes Q^T B, of which the first `rank` rows are enough.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& B) const;
  Eigen::MatrixXd solve_rotated(const Eigen::MatrixXd& QtB) const;

 private:
  Eigen::MatrixXd reflections_;
  Eigen::VectorXd coefficients_;
  Eigen::VectorXi order_;  // column of A for each column of R
  Eigen::Index rank_ = 0;
};

/// X that minimizes |A X - B| for A m x n, m >= n, of full rank.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// The first min(m, n) singular values, descending, and all n right singular vectors (columns) of
/// A, m x n.
struct SingularValues {
  Eigen::VectorXd values;
  Eigen::MatrixXd V;
};
SingularValues singular_values(const Eigen::MatrixXd& A);

/// A v = value v for a symmetric A, n x n; values ascending, vectors as columns of length 1.
struct Eigenpairs {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
struct ExtendedEigenpairs {
  VectorR values;
  MatrixR vectors;
};
Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A);
ExtendedEigenpairs eigenpairs(const MatrixR& A);

/// The real Schur form A = U S U^T, U orthogonal, S with diagonal blocks of order 1 and 2, of any
/// A, n x n. Throws ModelError if it was not found.
struct SchurForm {
  MatrixR U, S;
};
SchurForm schur_form(const MatrixR& A);
/// All eigenvalues of any A, n x n. Throws ModelError if they were not found.
VectorCR general_eigenvalues(const MatrixR& A);

/// K v = value M v with M positive definite and v^T M v = 1. Throws ModelError without a solution.
Eigenpairs eigenpairs(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M);

}  // namespace sprag
