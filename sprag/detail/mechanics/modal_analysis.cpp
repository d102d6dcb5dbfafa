#include "sprag/detail/mechanics/modal_analysis.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "sprag/model.h"

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

// From the real Schur form A = U S U^T, whose diagonal blocks contain the eigenvalues.
class InvariantSubspaces {
 public:
  struct Block {
    Eigen::Index row, order;
  };

  explicit InvariantSubspaces(const SchurForm& schur) : U_(schur.U), S_(schur.S) {
    noise_ = 1e-16L * S_.norm();
    for (Eigen::Index i = 0; i < S_.rows(); i += blocks_.back().order) {
      const bool pair = i + 1 < S_.rows() && S_(i + 1, i) != 0;
      blocks_.push_back({i, pair ? 2 : 1});
    }
  }

  const std::vector<Block>& blocks() const { return blocks_; }
  Real eigenvalue(std::size_t real_block) const {
    return S_(blocks_[real_block].row, blocks_[real_block].row);
  }

  // X and H with A X = X H, where H has the eigenvalues of one block, or of two blocks of order 1
  // in ascending order. The eigenvalues of H may be arbitrarily close: X spans their invariant
  // subspace and does not consist of eigenvectors.
  struct Subspace {
    MatrixR X, H;
  };
  Subspace subspace(const std::vector<std::size_t>& of) const {
    const Block last = blocks_[of.back()];
    const Eigen::Index n = last.row + last.order;
    const Eigen::Index columns = of.size() == 2 ? 2 : last.order;
    MatrixR X = MatrixR::Zero(S_.rows(), columns);
    MatrixR H = MatrixR::Zero(columns, columns);
    X.block(last.row, columns - last.order, last.order, last.order).setIdentity();
    H.bottomRightCorner(last.order, last.order) =
        S_.block(last.row, last.row, last.order, last.order);
    if (of.size() == 2) H(0, 0) = eigenvalue(of.front());
    for (std::size_t b = of.back(); b-- > 0;) {
      const auto [row, order] = blocks_[b];
      const Eigen::Index next = row + order;
      const MatrixR right =
          -product(S_.block(row, next, order, n - next), X.middleRows(next, n - next));
      if (of.size() == 2 && b == of.front()) {
        X(row, 0) = 1;
        H(0, 1) = -right(0, 1);
      } else {
        X.middleRows(row, order) = solve(S_.block(row, row, order, order), H, right);
      }
    }
    return {product(U_, X), H};
  }

 private:
  // Z with S Z - Z H = right, S and H of order 1 or 2. If S and H share an eigenvalue that is not
  // defective, `right` is compatible, and the free part of Z is set to zero.
  MatrixR solve(const MatrixR& S, const MatrixR& H, const MatrixR& right) const {
    const Eigen::Index n = S.rows();
    MatrixR op = MatrixR::Zero(right.size(), right.size());
    for (Eigen::Index j = 0; j < H.cols(); ++j) {
      op.block(j * n, j * n, n, n) = S;
      for (Eigen::Index i = 0; i < H.rows(); ++i) {
        op.block(j * n, i * n, n, n).diagonal().array() -= H(i, j);
      }
    }
    const VectorR b = right.reshaped();
    Eigen::FullPivLU<MatrixR> lu(op);
    if (lu.maxPivot() > noise_) {
      lu.setThreshold(noise_ / lu.maxPivot());
      const VectorR z = lu.solve(b);
      if (lu.isInvertible() || (op * z - b).norm() <= 100 * noise_ * (1 + z.norm())) {
        return z.reshaped(n, H.cols());
      }
    } else if (b.norm() <= 100 * noise_) {
      return MatrixR::Zero(n, H.cols());
    }
    // The shared eigenvalue is defective. With a shift of rounding size the solution becomes very
    // large and so is parallel to the existing eigenvector.
    op.diagonal().array() += noise_;
    return VectorR(op.fullPivLu().solve(b)).reshaped(n, H.cols());
  }

  MatrixR U_, S_;
  Real noise_ = 0;
  std::vector<Block> blocks_;
};

// The unit vector beta, on a grid of angles, for which N beta is farthest from parallel to beta,
// and the sine of the angle between the two.
struct Turn {
  Eigen::Matrix<Real, 2, 1> beta{1, 0};
  Real sine = 0;
};
Turn largest_turn(const Eigen::Matrix<Real, 2, 2>& N) {
  constexpr int angles = 48;
  static const std::array<Eigen::Matrix<Real, 2, 1>, angles> grid = [] {
    std::array<Eigen::Matrix<Real, 2, 1>, angles> directions;
    for (int k = 0; k < angles; ++k) {
      const Real phi = std::numbers::pi_v<Real> * static_cast<Real>(k) / angles;
      directions[static_cast<std::size_t>(k)] = {std::cos(phi), std::sin(phi)};
    }
    return directions;
  }();
  Turn best;
  const Real least = 1e-3L * N.norm();
  for (const auto& beta : grid) {
    const Eigen::Matrix<Real, 2, 1> image = N * beta;
    const Real length = image.norm();
    if (length <= least) continue;
    const Real sine = std::abs(beta[0] * image[1] - beta[1] * image[0]) / length;
    if (sine > best.sine) best = {beta, sine};
  }
  return best;
}

// Chooses the pairs of real eigenvalues that form one oscillator each. Near critical damping two
// eigenvalues (nearly) share one direction and must be paired. Two equal eigenvalues with two
// directions must not be. The sign of v^T (2 s + C) v divides the eigenvalues near critical damping
// into two kinds of equal number, so pairs of different kinds come first.
std::vector<std::vector<std::size_t>> real_pairs(const InvariantSubspaces& subspaces,
                                                 const VectorR& D, const MatrixR& C) {
  struct Single {
    std::size_t block;
    Real s;
    VectorR x;
    int kind;
  };
  const Eigen::Index r = D.size();
  std::vector<Single> singles;
  for (std::size_t b = 0; b < subspaces.blocks().size(); ++b) {
    if (subspaces.blocks()[b].order == 2) continue;
    const Real s = subspaces.eigenvalue(b);
    const VectorR x = subspaces.subspace({b}).X.col(0).normalized();
    const VectorR v = D.cwiseInverse().asDiagonal() * x.head(r);
    const Real damping = v.dot(C * v) / v.squaredNorm();
    const Real sign = (2 * s + damping) / (std::abs(s) + damping + 1e-12L * D.maxCoeff());
    singles.push_back({b, s, x, std::abs(sign) < 1e-3L ? 0 : (sign > 0 ? 1 : -1)});
  }

  struct Candidate {
    std::size_t i, j;
    bool same_kind;
    Real worth;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < singles.size(); ++i) {
    for (std::size_t j = i + 1; j < singles.size(); ++j) {
      const Single& a = singles[i];
      const Single& b = singles[j];
      const Real cosine = a.x.dot(b.x);
      const Real sine = std::max((b.x - cosine * a.x).norm(), Real(1e-18L));
      Eigen::Matrix<Real, 2, 2> N;
      N << -b.s, cosine * (b.s - a.s) / sine, 0, -a.s;
      candidates.push_back({i, j, a.kind * b.kind > 0, largest_turn(N).sine / sine});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.same_kind != b.same_kind ? b.same_kind : a.worth > b.worth;
  });
  std::vector<bool> taken(singles.size(), false);
  std::vector<std::vector<std::size_t>> pairs;
  for (const Candidate& candidate : candidates) {
    if (taken[candidate.i] || taken[candidate.j]) continue;
    taken[candidate.i] = taken[candidate.j] = true;
    pairs.push_back({singles[candidate.i].block, singles[candidate.j].block});
  }
  return pairs;
}

}  // namespace

MatrixR constrained_basis(const MatrixR& M, const MatrixR& W, const std::vector<int>& locked) {
  const Eigen::Index f = M.rows();
  const MatrixR L = cholesky_factor(M);
  const auto U = L.triangularView<Eigen::Lower>().transpose();
  if (W.cols() == 0) {
    return U.solve(MatrixR::Identity(f, f));
  }
  const MatrixR W_hat = L.triangularView<Eigen::Lower>().solve(W);
  const Eigen::HouseholderQR<MatrixR> qr(W_hat);
  const auto apart = qr.matrixQR().diagonal().cwiseAbs().transpose();
  if (W.cols() > f || (apart.array() <= 1e-12L * W_hat.colwise().norm().array()).any()) {
    throw ModelError("contacts " + names(locked) + " have linearly dependent directions w");
  }
  const MatrixR Q = qr.householderQ();
  return U.solve(Q.rightCols(f - W.cols()));
}

bool diagonalize(const MatrixR& K, const MatrixR& C, MatrixR& V) {
  if (K.size() == 0) {
    V.resize(0, 0);
    return true;
  }
  const Real tolerance = 1e-13L;
  const auto diagonal = [&](const MatrixR& A) {
    return largest_off_diagonal(congruent(V, A)) <= tolerance * A.norm();
  };
  V = eigenpairs(K).vectors;
  // Damping proportional to the mass is diagonal in any basis.
  const Real shared = C.trace() / static_cast<Real>(C.rows());
  const MatrixR rest = C - shared * MatrixR::Identity(C.rows(), C.cols());
  if (rest.norm() <= tolerance * C.norm() || diagonal(C)) return true;
  // Repeated eigenvalues of K leave V undetermined. A generic combination of K and C determines it.
  const Real scale_K = std::max(K.norm(), std::numeric_limits<Real>::min());
  const Real scale_C = std::max(C.norm(), std::numeric_limits<Real>::min());
  V = eigenpairs(K / scale_K + 0.6180339887498949L * C / scale_C).vectors;
  return diagonal(C) && diagonal(K);
}

void drop_noise(VectorR& kappa) {
  const Real scale = kappa.size() > 0 ? kappa.cwiseAbs().maxCoeff() : 0;
  for (Real& k : kappa) k = k > 1e-16L * scale ? k : 0;
}

ComplexModes complex_modes(const MatrixR& K, const MatrixR& C_hat) {
  const Eigen::Index r = K.rows();
  // x = (D eta, eta') in the modes of K, D their frequencies: both halves are in roots of energy.
  // This keeps the digits of a stiff machine's modes and makes those of light damping orthogonal.
  auto [Lambda, V] = eigenpairs(K);
  drop_noise(Lambda);
  const auto rigid = (Lambda.array() == 0).count();
  if (rigid > 1) {
    // Rigid motions that damping hardly couples: each oscillator must get position and velocity of
    // the same one.
    const MatrixR N = V.leftCols(rigid);
    V.leftCols(rigid) = product(N, eigenpairs(congruent(N, C_hat)).vectors);
  }
  const MatrixR C = congruent(V, C_hat);
  VectorR D = Lambda.cwiseSqrt();
  D.head(rigid).setConstant(rigid < r ? D[rigid] : C.norm());
  MatrixR A = MatrixR::Zero(2 * r, 2 * r);
  A.topRightCorner(r, r) = D.asDiagonal();
  A.bottomLeftCorner(r, r) = -Lambda.cwiseQuotient(D).asDiagonal().toDenseMatrix();
  A.bottomRightCorner(r, r) = -C;

  // Rigid positions come first. Their columns of A are zero, so their eigenvalues are exactly zero.
  const InvariantSubspaces subspaces(schur_form(A));
  std::vector<std::vector<std::size_t>> pairs = real_pairs(subspaces, D, C);
  for (std::size_t b = 0; b < subspaces.blocks().size(); ++b) {
    if (subspaces.blocks()[b].order == 2) pairs.push_back({b});
  }

  // A X = X H on the two-dimensional subspace of an oscillator. For any b in it,
  // a = A b + 2 delta b has A a = -kappa b and A b = a - 2 delta b: x = a z + b z'.
  ComplexModes modes{VectorR(r), VectorR(r), MatrixR(r, r), MatrixR(r, r), {}};
  MatrixR T(2 * r, 2 * r);
  for (Eigen::Index i = 0; i < r; ++i) {
    const auto [X, H] = subspaces.subspace(pairs[static_cast<std::size_t>(i)]);
    modes.delta[i] = std::max(-H.trace() / 2, Real(0));
    modes.kappa[i] = std::max(H(0, 0) * H(1, 1) - H(0, 1) * H(1, 0), Real(0));
    const Eigen::HouseholderQR<MatrixR> qr(X);
    const MatrixR Q = qr.householderQ() * MatrixR::Identity(2 * r, 2);
    const MatrixR triangle = qr.matrixQR().topRows(2).triangularView<Eigen::Upper>();
    MatrixR N = product(product(triangle, H), inverse(triangle));
    N.diagonal().array() += 2 * modes.delta[i];
    const Turn turn = largest_turn(N);
    T.col(i) = Q * (N * turn.beta);
    T.col(r + i) = Q * turn.beta;
    modes.P.col(i) = V * D.cwiseInverse().asDiagonal() * T.col(i).head(r);
    modes.R.col(i) = V * D.cwiseInverse().asDiagonal() * T.col(r + i).head(r);
    const Real scale =
        std::max(modes.P.col(i).norm(), std::sqrt(modes.kappa[i]) * modes.R.col(i).norm());
    T.col(i) /= scale;
    T.col(r + i) /= scale;
    modes.P.col(i) /= scale;
    modes.R.col(i) /= scale;
  }

  MatrixR to_x = MatrixR::Zero(2 * r, 2 * r);
  to_x.topLeftCorner(r, r) = D.asDiagonal() * V.transpose();
  to_x.bottomRightCorner(r, r) = V.transpose();
  const VectorR lengths = T.colwise().norm();
  const auto [X, rcond] = sprag::solve(T * lengths.cwiseInverse().asDiagonal(), to_x);
  // Below this a state in double would keep fewer than nine digits.
  if (!(rcond > 1e-7L)) {
    throw ModelError(
        "M, C and K have a defective mode that is not critical damping; change the damping a "
        "little");
  }
  modes.T_inverse = lengths.cwiseInverse().asDiagonal() * X;
  return modes;
}

Response response(const VectorR& delta, const VectorR& kappa, const VectorCR& forcing, Real Omega,
                  Real noise) {
  // Outside these limits the steady response is at most 16 times the response to the force within
  // one period.
  constexpr Real near = 1.0L / 16;
  constexpr Real loose = 1.0L / 1024;
  const Eigen::Index n = forcing.size();
  Response response{VectorCR::Zero(n), VectorCR::Zero(n)};
  const Real least = n > 0 ? noise * forcing.cwiseAbs().maxCoeff() : 0;
  const Real Omega2 = Omega * Omega;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Complex denominator(kappa[i] - Omega2, 2 * delta[i] * Omega);
    if (std::abs(forcing[i]) <= least) continue;
    if (std::abs(denominator) <= near * std::max(kappa[i], Omega2) || kappa[i] <= loose * Omega2) {
      response.drive[i] = forcing[i];
    } else {
      response.steady[i] = forcing[i] / denominator;
    }
  }
  return response;
}

}  // namespace sprag::modal
