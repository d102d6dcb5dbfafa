#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/model.h"

namespace sprag {
namespace {

Eigen::RealSchur<MatrixR> real_schur(const MatrixR& A, bool with_U) {
  Eigen::RealSchur<MatrixR> schur(A, with_U);
  if (schur.info() != Eigen::Success) throw ModelError("eigenvalues were not found");
  return schur;
}

}  // namespace

MatrixR product(const Eigen::Ref<const MatrixR>& A, const Eigen::Ref<const MatrixR>& B) {
  if (A.isDiagonal(0)) return A.diagonal().asDiagonal() * B;
  return A * B;
}

MatrixCR complex_product(const MatrixR& A, const MatrixCR& B) {
  MatrixCR AB(A.rows(), B.cols());
  AB.real() = product(A, B.real());
  AB.imag() = product(A, B.imag());
  return AB;
}

MatrixR congruent(const Eigen::Ref<const MatrixR>& B, const Eigen::Ref<const MatrixR>& A) {
  return product(B.transpose(), product(A, B));
}

MatrixR inverse(const MatrixR& A) { return A.inverse(); }

Solution solve(const MatrixR& A, const MatrixR& B) {
  const Eigen::PartialPivLU<MatrixR> lu(A);
  return {lu.solve(B), lu.rcond()};
}

MatrixCR solve(const MatrixCR& A, const MatrixCR& B) {
  const Eigen::Index n = A.rows();
  MatrixR parts(2 * n, 2 * n), right(2 * n, B.cols());
  parts << A.real(), -A.imag(), A.imag(), A.real();
  right << B.real(), B.imag();
  const MatrixR x = solve(parts, right).X;
  MatrixCR X(n, B.cols());
  X.real() = x.topRows(n);
  X.imag() = x.bottomRows(n);
  return X;
}

MatrixR cholesky_factor(const MatrixR& M) { return Eigen::LLT<MatrixR>(M).matrixL(); }

MatrixR solve_definite(const MatrixR& M, const MatrixR& B) {
  return Eigen::LLT<MatrixR>(M).solve(B);
}

SchurForm schur_form(const MatrixR& A) {
  const Eigen::RealSchur<MatrixR> schur = real_schur(A, true);
  return {schur.matrixU(), schur.matrixT()};
}

VectorCR general_eigenvalues(const MatrixR& A) {
  const MatrixR S = real_schur(A, false).matrixT();
  VectorCR values(S.rows());
  for (Eigen::Index i = 0; i < S.rows(); ++i) {
    values[i] = S(i, i);
    if (i + 1 == S.rows() || S(i + 1, i) == 0) continue;
    // A conjugate pair.
    const Extended p = (S(i, i) - S(i + 1, i + 1)) / 2;
    const Extended imaginary = std::sqrt(std::abs(p * p + S(i, i + 1) * S(i + 1, i)));
    values[i] = {S(i + 1, i + 1) + p, imaginary};
    values[i + 1] = std::conj(values[i]);
    ++i;
  }
  return values;
}

ExtendedEigenpairs eigenpairs(const MatrixR& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixR> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace sprag
