#include "sprag/detail/mechanics/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "sprag/model.h"

namespace sprag {
namespace {

void rotate(const Eigen::MatrixXd& reflections, const Eigen::VectorXd& coefficients,
            Eigen::MatrixXd& B) {
  B.applyOnTheLeft(Eigen::householderSequence(reflections, coefficients));
}

void rotate_back(const Eigen::MatrixXd& reflections, const Eigen::VectorXd& coefficients,
                 Eigen::MatrixXd& B) {
  B.applyOnTheLeft(Eigen::householderSequence(reflections, coefficients).transpose());
}

}  // namespace

Eigen::MatrixXd product(const Eigen::Ref<const Eigen::MatrixXd>& A,
                        const Eigen::Ref<const Eigen::MatrixXd>& B) {
  return A * B;
}

Eigen::MatrixXd congruent(const Eigen::Ref<const Eigen::MatrixXd>& B,
                          const Eigen::Ref<const Eigen::MatrixXd>& A) {
  return product(B.transpose(), product(A, B));
}

bool factorize(Eigen::Ref<Eigen::MatrixXd> M) {
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(M).info() == Eigen::Success;
}

CholeskyFactor::CholeskyFactor(const Eigen::MatrixXd& M) : L_(M), exists_(factorize(L_)) {
  L_.triangularView<Eigen::StrictlyUpper>().setZero();
}

Eigen::MatrixXd CholeskyFactor::solve_L(const Eigen::MatrixXd& B) const {
  return L_.triangularView<Eigen::Lower>().solve(B);
}

Eigen::MatrixXd CholeskyFactor::solve(const Eigen::MatrixXd& B) const {
  return L_.triangularView<Eigen::Lower>().transpose().solve(solve_L(B));
}

bool is_nearly_diagonal(const Eigen::MatrixXd& A) {
  if (A.size() == 0) return true;
  const double largest = A.cwiseAbs().maxCoeff();
  Eigen::MatrixXd rest = A;
  rest.diagonal().setZero();
  return rest.cwiseAbs().maxCoeff() <= 1e-12 * largest;
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& A) { return A.inverse(); }

QR::QR(const Eigen::MatrixXd& A) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A);
  reflections_ = qr.matrixQR();
  coefficients_ = qr.hCoeffs();
}

Eigen::MatrixXd QR::R() const {
  return reflections_.topRows(coefficients_.size()).triangularView<Eigen::Upper>();
}

Eigen::MatrixXd QR::Q_times(Eigen::MatrixXd B) const {
  rotate(reflections_, coefficients_, B);
  return B;
}

Eigen::MatrixXd QR::solve_R_transposed(const Eigen::MatrixXd& B) const {
  return reflections_.topRows(coefficients_.size())
      .triangularView<Eigen::Upper>()
      .transpose()
      .solve(B);
}

PivotedQR::PivotedQR(const Eigen::MatrixXd& A, double threshold) {
  reflections_ = A;
  if (A.cols() == 0) return;  // Eigen would take the maximum over no columns
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(threshold);
  qr.compute(A);
  reflections_ = qr.matrixQR();
  coefficients_ = qr.hCoeffs();
  order_ = qr.colsPermutation().indices();
  rank_ = qr.rank();
}

Eigen::MatrixXd PivotedQR::Q_times(Eigen::MatrixXd B) const {
  rotate(reflections_, coefficients_, B);
  return B;
}

Eigen::MatrixXd PivotedQR::Q_transposed_times(Eigen::MatrixXd B) const {
  rotate_back(reflections_, coefficients_, B);
  return B;
}

Eigen::MatrixXd PivotedQR::solve(const Eigen::MatrixXd& B) const {
  return solve_rotated(Q_transposed_times(B));
}

// Eigen's solve() determines the rank by exact zeros; this uses the threshold.
Eigen::MatrixXd PivotedQR::solve_rotated(const Eigen::MatrixXd& QtB) const {
  const Eigen::MatrixXd Y = reflections_.topLeftCorner(rank_, rank_)
                                .triangularView<Eigen::Upper>()
                                .solve(QtB.topRows(rank_));
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(order_.size(), QtB.cols());
  for (Eigen::Index k = 0; k < rank_; ++k) X.row(order_[k]) = Y.row(k);
  return X;
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(A).solve(B);
}

SingularValues singular_values(const Eigen::MatrixXd& A) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigenpairs eigenpairs(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(K, M);
  if (solver.info() != Eigen::Success) throw ModelError("K v = w^2 M v has no solution");
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace sprag
