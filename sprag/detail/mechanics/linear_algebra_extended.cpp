#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/model.h"

namespace sprag {

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
  const Eigen::RealSchur<MatrixR> schur(A);
  if (schur.info() != Eigen::Success) {
    throw ModelError("eigenvalues were not found");
  }
  return {schur.matrixU(), schur.matrixT()};
}

ExtendedEigenpairs eigenpairs(const MatrixR& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixR> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace sprag
