// The linear complementarity problem 0 <= x _|_ y = A x + b >= 0 by its residual, recomputed in
// extended precision, and compared with all bases.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <optional>
#include <string>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Real = Extended;

struct Lcp {
  MatrixXd A;
  VectorXd b;
};

/// Well conditioned apart from scales of rows and columns, which differ by up to `spread`.
Lcp random_problem(Random& random, int n, double spread) {
  VectorXd scale(n);
  for (double& s : scale) s = random.log_uniform(1.0 / std::sqrt(spread), std::sqrt(spread));
  const MatrixXd A =
      scale.asDiagonal() * random.positive_definite(n, 0.05, 2.0) * scale.asDiagonal();
  VectorXd b = random.vector(n);
  if (random.chance(0.3)) b = -b.cwiseAbs();                  // all pressed
  if (random.chance(0.2)) b[random.integer(0, n - 1)] = 0.0;  // one at rest
  return {0.5 * (A + A.transpose()), scale.cwiseProduct(b)};
}

/// Largest violation of the problem, each row relative to its terms.
Real residual(const Lcp& problem, const VectorXd& x, const VectorXd& y) {
  const MatrixR A = problem.A.cast<Real>();
  const VectorR b = problem.b.cast<Real>();
  const VectorR exact = A * x.cast<Real>() + b;
  const VectorR terms = A.cwiseAbs() * x.cast<Real>().cwiseAbs() + b.cwiseAbs();
  Real worst = 0;
  for (Eigen::Index i = 0; i < b.size(); ++i) {
    if (x[i] < 0.0 || y[i] < 0.0 || x[i] * y[i] != 0.0) return 1;
    const Real violation = x[i] > 0.0 ? std::abs(exact[i]) : std::max(-exact[i], Real(0));
    const Real off = std::max(violation, std::abs(exact[i] - Real(y[i])));
    if (off > 0) worst = std::max(worst, off / terms[i]);
  }
  return worst;
}

/// x by trying all 2^n bases: the one with positive, or least negative, x_B and y_N.
VectorR by_all_bases(const Lcp& problem) {
  const auto n = problem.b.size();
  const MatrixR A = problem.A.cast<Real>();
  const VectorR b = problem.b.cast<Real>();
  VectorR best = VectorR::Zero(n);
  std::optional<Real> least;
  for (unsigned basis = 0; basis < (1U << n); ++basis) {
    std::vector<Eigen::Index> in;
    for (Eigen::Index i = 0; i < n; ++i) {
      if ((basis >> i & 1U) != 0) in.push_back(i);
    }
    VectorR x = VectorR::Zero(n);
    if (!in.empty()) x(in) = -solve(MatrixR(A(in, in)), VectorR(b(in))).X;
    const VectorR y = A * x + b;
    const VectorR terms = A.cwiseAbs() * x.cwiseAbs() + b.cwiseAbs();
    Real violation = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if ((basis >> i & 1U) != 0) {
        violation = std::max(violation, -x[i] * A(i, i) / std::max(terms[i], Real(1e-300)));
      } else if (y[i] < 0) {
        violation = std::max(violation, -y[i] / terms[i]);
      }
    }
    if (!least || violation < *least) {
      least = violation;
      best = x;
    }
  }
  return best;
}

void check(const Lcp& problem, const std::string& where) {
  SCOPED_TRACE(where);
  ContactVector x, y;
  ASSERT_EQ(solve_lcp(problem.A, problem.b, x, y), Solved::yes);
  ASSERT_LE(static_cast<double>(residual(problem, x, y)), 1e-12);
  if (problem.b.size() > 6) return;
  const VectorR expected = by_all_bases(problem);
  // Impulses of different units are compared by their effect: |A_ii| x_i relative to the row's
  // terms.
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Real unit = std::sqrt(Real(problem.A(i, i)));
    Real size = 0;
    for (Eigen::Index j = 0; j < x.size(); ++j) {
      const Real unit_j = std::sqrt(Real(problem.A(j, j)));
      size = std::max({size, unit_j * expected[j], std::abs(problem.b[j]) / unit_j});
    }
    ASSERT_LE(static_cast<double>(std::abs(Real(x[i]) - expected[i]) * unit),
              1e-12 * static_cast<double>(size))
        << "x_" << i;
  }
}

TEST(Complementarity, IsSolvedForAnyScalingOfRows) {
  const std::uint64_t seed = 102;
  Random random(seed);
  for (int i = 0; i < repetitions(8000); ++i) {
    const int n = random.integer(1, 8);
    check(random_problem(random, n, random.log_uniform(1.0, 1e6)),
          "seed " + std::to_string(seed) + ", case " + std::to_string(i));
    if (HasFatalFailure()) return;
  }
}

TEST(Complementarity, IsSolvedForLargestNumberOfContacts) {
  const std::uint64_t seed = 103;
  Random random(seed);
  for (int i = 0; i < repetitions(60); ++i) {
    check(random_problem(random, max_contacts, 1.0),
          "seed " + std::to_string(seed) + ", case " + std::to_string(i));
    if (HasFatalFailure()) return;
  }
}

TEST(Complementarity, EmptyProblemIsSolved) {
  ContactVector x, y;
  EXPECT_EQ(solve_lcp(ContactMatrix(0, 0), ContactVector(0), x, y), Solved::yes);
  EXPECT_EQ(x.size(), 0);
}

// Rows with x = 0 and y = 0, exactly or up to rounding.
TEST(Complementarity, DegenerateRowsAreSolved) {
  const std::uint64_t seed = 104;
  Random random(seed);
  for (int i = 0; i < repetitions(5000); ++i) {
    const int n = random.integer(2, 6);
    Lcp problem = random_problem(random, n, 1.0);
    VectorXd x = random.vector(n).cwiseMax(0.0);
    VectorXd y = (x.array() > 0.0).select(0.0, random.vector(n).cwiseMax(0.0));
    problem.b = y - problem.A * x;
    ContactVector x_solved, y_solved;
    ASSERT_EQ(solve_lcp(problem.A, problem.b, x_solved, y_solved), Solved::yes) << "case " << i;
    ASSERT_LE((x_solved - x).cwiseAbs().maxCoeff(), 1e-13) << "seed " << seed << ", case " << i;
    ASSERT_LE((y_solved - y).cwiseAbs().maxCoeff(), 1e-13) << "seed " << seed << ", case " << i;
  }
}

// Y. Fathi, Math. Program. 17 (1979): on A = L L^T, L unit lower triangular with twos below the
// diagonal, b = -1, the least-index rule needs 2^n - 1 pivots; in reverse order, fewer. The problem
// is well conditioned.
TEST(Complementarity, IsSolvedWhereTheLeastIndexRuleIsSlowest) {
  for (const int n : {2, 4, 8, 9, 10, 12}) {
    MatrixXd L = MatrixXd::Identity(n, n);
    L.triangularView<Eigen::StrictlyLower>().setConstant(2.0);
    const MatrixXd LLt = product(L, L.transpose());
    for (const MatrixXd& A : {LLt, MatrixXd(LLt.reverse()), product(L.transpose(), L)}) {
      const Lcp problem{A, VectorXd::Constant(n, -1.0)};
      ContactVector x, y;
      ASSERT_EQ(solve_lcp(problem.A, problem.b, x, y), Solved::yes) << "n = " << n;
      EXPECT_LE(static_cast<double>(residual(problem, x, y)), 1e-12) << "n = " << n;
    }
  }
}

// All contacts of W are pressed, but W has dependent columns. Many x solve the problem, and
// choosing one of them would be arbitrary. If no contact is pressed, x = 0 is unique.
void expect_dependent(const MatrixXd& W, const VectorXd& impulses, const std::string& where) {
  const MatrixXd A = product(W.transpose(), W);
  const VectorXd b = -(A * impulses);
  ContactVector x, y;
  EXPECT_EQ(solve_lcp(A, b, x, y), Solved::dependent) << where << "\nA =\n"
                                                      << A << "\nb = " << b.transpose();
  EXPECT_EQ(solve_lcp(A, VectorXd::Ones(b.size()), x, y), Solved::yes) << where;
  EXPECT_EQ(VectorXd(x), VectorXd::Zero(b.size())) << where;
}

TEST(DependentDirections, AnyNumberHasUniqueSolution) {
  const std::uint64_t seed = 105;
  Random random(seed);
  for (int i = 0; i < repetitions(500); ++i) {
    const int rank = random.integer(1, 5);
    const int n = rank + random.integer(1, 3);
    MatrixXd W(rank, n);
    W.leftCols(rank) = random.orthogonal(rank) + 0.3 * random.matrix(rank, rank);
    for (int k = rank; k < n; ++k) {
      const int kind = random.integer(0, 2);
      const int twin = random.integer(0, rank - 1);
      if (kind == 0) W.col(k) = random.matrix(rank, 1);
      if (kind == 1) W.col(k) = W.col(twin) * random.log_uniform(0.1, 10.0);
      if (kind == 2) W.col(k) = -W.col(twin);
    }
    VectorXd impulses(n);
    for (double& x : impulses) x = random.uniform(0.5, 2.0);
    expect_dependent(W, impulses, "seed " + std::to_string(seed) + ", case " + std::to_string(i));
    if (HasFailure()) return;
  }
}

// Dependent directions with loads of all signs: y is the unique solution in any order, and the
// loaded contacts are independent.
TEST(DependentDirections, MotionIsUniqueForAnyOrder) {
  const std::uint64_t seed = 106;
  Random random(seed);
  int dependent = 0;
  for (int i = 0; i < repetitions(4000); ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", case " + std::to_string(i));
    const int rank = random.integer(1, 5);
    const int n = rank + random.integer(0, 3);
    MatrixXd W = random.matrix(rank, n);
    for (int k = rank; k < n; ++k) {
      const int twin = random.integer(0, rank - 1);
      if (random.chance(0.7)) W.col(k) = (random.chance(0.5) ? -1.0 : 1.0) * W.col(twin);
    }
    // All directions have a component along u0, so that some motion satisfies all constraints.
    const VectorXd u0 = random.vector(rank);
    for (int k = 0; k < n; ++k) {
      if (W.col(k).dot(u0) < 0.0) W.col(k) *= -1.0;
    }
    const ContactMatrix G = product(W.transpose(), W);
    const ContactVector b = 2.0 * product(W.transpose(), random.vector(rank));
    const ContactVector noise = ContactVector::Zero(n);
    ContactVector x, y;
    ContactSet unsatisfied = 0;
    ASSERT_EQ(solve_semidefinite_lcp(G, b, noise, x, y, unsatisfied), Solved::yes);
    ASSERT_EQ(unsatisfied, 0U);
    ASSERT_GE(x.minCoeff(), 0.0);
    ASSERT_GE(y.minCoeff(), 0.0);
    const double size = 1.0 + x.cwiseAbs().maxCoeff();
    ASSERT_LE((VectorXd(G * x + b) - VectorXd(y)).cwiseAbs().maxCoeff(), 1e-11 * size);
    ASSERT_LE(std::abs(x.dot(y)), 1e-11 * size);
    ContactSet carrying = 0;
    for (int k = 0; k < n; ++k) carrying |= x[k] > 0.0 ? bit(k) : 0;
    ASSERT_EQ(independent_of(G, 0, carrying), carrying);
    if (independent_of(G, 0, bit(n) - 1) != bit(n) - 1) ++dependent;

    const ContactMatrix G_reversed = G.reverse();
    const ContactVector b_reversed = b.reverse();
    ContactVector x_reversed, y_reversed;
    ASSERT_EQ(
        solve_semidefinite_lcp(G_reversed, b_reversed, noise, x_reversed, y_reversed, unsatisfied),
        Solved::yes);
    ASSERT_LE((VectorXd(y) - VectorXd(y_reversed.reverse())).cwiseAbs().maxCoeff(), 1e-11 * size);
  }
  EXPECT_GT(dependent, repetitions(4000) / 3);
}

// A constraint that the others violate by 1e-10 of its terms is no rounding.
TEST(DependentDirections, SmallViolationIsResolved) {
  ContactMatrix A(3, 3);
  A << 1.0, 1.0, 0.5, 1.0, 1.0, 0.5, 0.5, 0.5, 1.0;
  const ContactVector b = Eigen::Vector3d(-1.0, -1.0, -0.5 - 1e-10);
  ContactVector x, y;
  ContactSet unsatisfied = 0;
  ASSERT_EQ(solve_semidefinite_lcp(A, b, Eigen::Vector3d::Zero(), x, y, unsatisfied), Solved::yes);
  EXPECT_EQ(unsatisfied, 0U);
  EXPECT_GE((VectorXd(A * x + b)).minCoeff(), -1e-14);
}

// Two opposite walls that approach each other: no motion satisfies both constraints.
TEST(DependentDirections, UnsatisfiableConstraintIsOmitted) {
  ContactMatrix A(2, 2);
  A << 1.0, -1.0, -1.0, 1.0;
  ContactVector x, y;
  ContactSet unsatisfied = 0;
  ASSERT_EQ(solve_semidefinite_lcp(A, Eigen::Vector2d(-1.0, -0.5), Eigen::Vector2d::Zero(), x, y,
                                   unsatisfied),
            Solved::yes);
  ASSERT_EQ(std::popcount(unsatisfied), 1);
  const int out = std::countr_zero(unsatisfied);
  EXPECT_EQ(x[out], 0.0);
  EXPECT_LT(y[out], 0.0);
  EXPECT_EQ(y[1 - out], 0.0);
}

}  // namespace
}  // namespace sprag
