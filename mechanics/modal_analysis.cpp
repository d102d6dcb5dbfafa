#include "mechanics/modal_analysis.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <limits>
#include <string>

#include "mechanics/model.h"

namespace sprag::modal {
namespace {

std::string names(const std::vector<int>& contacts) {
  std::string text;
  for (const int i : contacts) text += (text.empty() ? "" : ", ") + std::to_string(i + 1);
  return text;
}

Real largest_off_diagonal(const MatrixR& A) {
  Real largest = 0;
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      if (i != j) largest = std::max(largest, std::abs(A(i, j)));
    }
  }
  return largest;
}

}  // namespace

MatrixR constrained_basis(const MatrixR& M, const MatrixR& W, const std::vector<int>& locked) {
  const Eigen::Index f = M.rows();
  const Eigen::LLT<MatrixR> factor(M);
  if (W.cols() == 0) {
    return factor.matrixU().solve(MatrixR::Identity(f, f));
  }
  const MatrixR W_hat = factor.matrixL().solve(W);
  Eigen::ColPivHouseholderQR<MatrixR> qr(W_hat);
  qr.setThreshold(1e-12L);
  if (qr.rank() < W.cols()) {
    throw ModelError("contacts " + names(locked) + " have linearly dependent directions w");
  }
  const MatrixR Q = qr.householderQ();
  return factor.matrixU().solve(Q.rightCols(f - W.cols()));
}

bool diagonalize(const MatrixR& K, const MatrixR& C, MatrixR& V) {
  if (K.size() == 0) {
    V.resize(0, 0);
    return true;
  }
  const Real tolerance = 1e-13L;
  const auto both_diagonal = [&] {
    return largest_off_diagonal(V.transpose() * C * V) <= tolerance * C.norm() &&
           largest_off_diagonal(V.transpose() * K * V) <= tolerance * K.norm();
  };
  V = Eigen::SelfAdjointEigenSolver<MatrixR>(K).eigenvectors();
  if (both_diagonal()) return true;
  // Repeated eigenvalues of K leave V undetermined; a generic combination settles it.
  const Real scale_K = std::max(K.norm(), std::numeric_limits<Real>::min());
  const Real scale_C = std::max(C.norm(), std::numeric_limits<Real>::min());
  V = Eigen::SelfAdjointEigenSolver<MatrixR>(K / scale_K + 0.6180339887498949L * C / scale_C)
          .eigenvectors();
  return both_diagonal();
}

void drop_noise(VectorR& kappa) {
  const Real scale = kappa.size() > 0 ? kappa.cwiseAbs().maxCoeff() : 0;
  for (Real& k : kappa) k = k > 1e-16L * scale ? k : 0;
}

ComplexModes complex_modes(const MatrixR& K, const MatrixR& C) {
  const Eigen::Index r = K.rows();
  MatrixR A = MatrixR::Zero(2 * r, 2 * r);
  A.topRightCorner(r, r).setIdentity();
  A.bottomLeftCorner(r, r) = -K;
  A.bottomRightCorner(r, r) = -C;
  const Eigen::EigenSolver<MatrixR> solver(A);
  const VectorCR values = solver.eigenvalues();
  const MatrixCR vectors = solver.eigenvectors().topRows(r);
  ComplexModes modes{VectorR(r), VectorR(r), MatrixR(r, r), MatrixR(r, r)};
  Eigen::Index count = 0;
  std::vector<Eigen::Index> real_values;
  for (Eigen::Index i = 0; i < 2 * r; ++i) {
    const Real omega = values[i].imag();
    if (omega == 0) real_values.push_back(i);
    if (omega <= 0 || count == r) continue;
    const Real delta = -values[i].real();
    modes.delta[count] = std::max(delta, Real(0));
    modes.kappa[count] = std::norm(values[i]);
    modes.R.col(count) = vectors.col(i).imag() / omega;
    modes.P.col(count) = vectors.col(i).real() + delta * modes.R.col(count);
    ++count;
  }
  for (std::size_t j = 0; j + 1 < real_values.size() && count < r; j += 2, ++count) {
    const Real s1 = values[real_values[j]].real();
    const Real s2 = values[real_values[j + 1]].real();
    const VectorR v1 = vectors.col(real_values[j]).real();
    const VectorR v2 = vectors.col(real_values[j + 1]).real();
    modes.delta[count] = std::max(-(s1 + s2) / 2, Real(0));
    modes.kappa[count] = std::max(s1 * s2, Real(0));
    modes.R.col(count) = (v1 - v2) / (s1 - s2);
    modes.P.col(count) = (s1 * v2 - s2 * v1) / (s1 - s2);
  }
  return modes;
}

VectorCR response(const VectorR& delta, const VectorR& kappa, const VectorCR& forcing, Real Omega) {
  VectorCR z(forcing.size());
  const Real scale = forcing.size() > 0 ? forcing.cwiseAbs().maxCoeff() : 0;
  for (Eigen::Index i = 0; i < forcing.size(); ++i) {
    const std::complex<Real> denominator(kappa[i] - Omega * Omega, 2 * delta[i] * Omega);
    if (std::abs(forcing[i]) <= 1e-18L * scale) {
      z[i] = 0;
      continue;
    }
    if (std::abs(denominator) <= 1e-12L * std::max(kappa[i], Omega * Omega)) {
      throw ModelError("undamped resonance: the excitation's frequency " +
                       std::to_string(static_cast<double>(Omega)) +
                       " is that of an undamped mode it drives");
    }
    z[i] = forcing[i] / denominator;
  }
  return z;
}

}  // namespace sprag::modal
