#include "sprag/mechanics/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "sprag/mechanics/model.h"

namespace sprag {

Eigen::MatrixXd product(const Eigen::Ref<const Eigen::MatrixXd>& A,
                        const Eigen::Ref<const Eigen::MatrixXd>& B) {
  return A * B;
}

Eigen::MatrixXd congruent(const Eigen::Ref<const Eigen::MatrixXd>& B,
                          const Eigen::Ref<const Eigen::MatrixXd>& A) {
  return product(B.transpose(), product(A, B));
}

CholeskyFactor::CholeskyFactor(const Eigen::MatrixXd& M) {
  const Eigen::LLT<Eigen::MatrixXd> factor(M);
  exists_ = factor.info() == Eigen::Success;
  L_ = factor.matrixL();
}

Eigen::MatrixXd CholeskyFactor::solve_L(const Eigen::MatrixXd& B) const {
  return L_.triangularView<Eigen::Lower>().solve(B);
}

Eigen::MatrixXd CholeskyFactor::solve(const Eigen::MatrixXd& B) const {
  return L_.triangularView<Eigen::Lower>().transpose().solve(solve_L(B));
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& A) { return A.inverse(); }

Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigenpairs eigenpairs(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(K, M);
  if (solver.info() != Eigen::Success) throw ModelError("K v = w^2 M v has no solution");
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace sprag
