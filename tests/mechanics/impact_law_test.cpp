// The impact laws by examples calculated by hand and by properties of every impact. The distance of
// two machines is tested in impact_distance_test.cpp, the complementarity problem in
// complementarity_test.cpp.
#include "sprag/detail/mechanics/impact_law.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr ImpactLaw laws[] = {ImpactLaw::poisson, ImpactLaw::newton};

/// Effect of an impact on a machine with mass M and closed contacts of directions W.
struct Outcome {
  VectorXd Lambda, gamma_plus, u_plus;
};

MatrixXd delassus(const MatrixXd& M, const MatrixXd& W) {
  return product(W.transpose(), CholeskyFactor(M).solve(W));
}

double rcond(const MatrixXd& G) {
  const VectorXd values = eigenvalues(G);
  return values[0] / values[values.size() - 1];
}

Outcome impact_on(ImpactLaw law, const MatrixXd& M, const MatrixXd& W, const VectorXd& epsilon,
                  const VectorXd& u) {
  ContactVector Lambda, gamma_plus;
  const ContactMatrix G = delassus(M, W);
  const ContactVector gamma_minus = W.transpose() * u;
  EXPECT_EQ(impact(law, G, epsilon, gamma_minus, Lambda, gamma_plus), Solved::yes);
  return {Lambda, gamma_plus, u + CholeskyFactor(M).solve(W * Lambda)};
}

/// The same from G itself.
Outcome impact_on(ImpactLaw law, const MatrixXd& G, const VectorXd& epsilon,
                  const VectorXd& gamma_minus) {
  ContactVector Lambda, gamma_plus;
  EXPECT_EQ(impact(law, G, epsilon, gamma_minus, Lambda, gamma_plus), Solved::yes);
  return {Lambda, gamma_plus, {}};
}

double kinetic_energy(const MatrixXd& M, const VectorXd& u) { return 0.5 * u.dot(M * u); }

VectorXd numbers(std::initializer_list<double> list) {
  VectorXd x(static_cast<Eigen::Index>(list.size()));
  std::copy(list.begin(), list.end(), x.begin());
  return x;
}

double distance(const VectorXd& a, const VectorXd& b) { return (a - b).cwiseAbs().maxCoeff(); }

// G = [[1, -0.8], [-0.8, 1]], gamma- = (-1, 0.3): the second contact separates before, and the
// impulse of the first pushes it back. Newton's law, gamma+ = -E gamma- with both contacts pressed,
// lets it approach afterwards, Poisson's stops it: compression Lambda_C = (0.76, 0.5) / 0.36,
// expansion E Lambda_C, and nu against penetration.
TEST(TwoContacts, FollowTheLawsByHand) {
  using Eigen::Vector2d;
  const double nu = (0.8 * 0.532 - 0.1) / 0.36, nu_1 = 0.8 * 0.5 / 0.36;
  const struct {
    ImpactLaw law;
    Vector2d epsilon, gamma_plus, Lambda;
  } cases[] = {
      {ImpactLaw::newton, {0.7, 0.7}, {0.7, -0.21}, {1.7 * 0.76 / 0.36, 1.7 * 0.5 / 0.36}},
      {ImpactLaw::poisson, {0.7, 0.7}, {0.532, 0.0}, {1.7 * 0.76 / 0.36, 1.7 * 0.5 / 0.36 + 0.21}},
      {ImpactLaw::newton, {0.7, 0.2}, {0.7, -0.06}, {1.412 / 0.36, 1.0 / 0.36}},
      {ImpactLaw::poisson, {0.7, 0.2}, {0.532, 0.0}, {1.292 / 0.36, 0.6 / 0.36 + nu}},
      // The second contact expands more than the first and leaves with 0.38.
      {ImpactLaw::poisson,
       {0.0, 1.0},
       {0.0, 0.5 / 0.36 - 0.8 * nu_1},
       {0.76 / 0.36 + nu_1, 1.0 / 0.36}}};
  MatrixXd W0(2, 2);
  W0 << 1.0, -0.8, 0.0, 0.6;
  MatrixXd coupled(2, 2);
  coupled << 2.0, 0.6, 0.6, 0.5;
  for (const MatrixXd& M : {MatrixXd(MatrixXd::Identity(2, 2)), coupled}) {
    const MatrixXd W = product(CholeskyFactor(M).L(), W0);
    const VectorXd u = inverse(MatrixXd(W.transpose())) * numbers({-1.0, 0.3});
    for (const auto& of : cases) {
      const Outcome out = impact_on(of.law, M, W, of.epsilon, u);
      EXPECT_LE(distance(out.gamma_plus, of.gamma_plus), 1e-14) << of.epsilon.transpose();
      EXPECT_LE(distance(out.Lambda, of.Lambda), 1e-13) << of.epsilon.transpose();
      EXPECT_LE(distance(W.transpose() * out.u_plus, out.gamma_plus), 1e-14);
    }
  }
}

// An elastic ball hits two that touch: in the expansion the second contact transmits the impulse
// only as far as the balls do not pull.
TEST(ThreeBalls, RestPairMovesAsOneMass) {
  MatrixXd W(3, 2);
  W << -1, 0, 1, -1, 0, 1;
  const MatrixXd M = MatrixXd::Identity(3, 3);
  const VectorXd u = numbers({1.0, 0.0, 0.0});
  const MatrixXd G = delassus(M, W);
  EXPECT_EQ(G(0, 0), 2.0);
  EXPECT_EQ(G(0, 1), -1.0);
  EXPECT_EQ(G(1, 1), 2.0);
  for (const ImpactLaw law : laws) {
    const Outcome out = impact_on(law, M, W, numbers({1.0, 1.0}), u);
    EXPECT_LE(distance(out.u_plus, numbers({-1.0 / 3, 2.0 / 3, 2.0 / 3})), 1e-15);
    EXPECT_LE(distance(out.gamma_plus, numbers({1.0, 0.0})), 1e-15);
    EXPECT_LE(distance(out.Lambda, numbers({4.0 / 3, 2.0 / 3})), 1e-15);
    EXPECT_NEAR(kinetic_energy(M, out.u_plus), 0.5, 1e-15);
  }
}

TEST(OneContact, FollowsTheClosedForm) {
  Random random(11);
  for (int i = 0; i < 20000; ++i) {
    const MatrixXd G = MatrixXd::Constant(1, 1, random.log_uniform(1e-6, 1e6));
    const double epsilon = random.chance(0.1) ? double(random.integer(0, 1)) : random.uniform(0, 1);
    const double gamma = random.chance(0.05) ? 0.0 : random.uniform(-2, 2);
    const double after = gamma < 0.0 ? -epsilon * gamma : gamma;
    for (const ImpactLaw law : laws) {
      const Outcome out = impact_on(law, G, numbers({epsilon}), numbers({gamma}));
      ASSERT_NEAR(out.gamma_plus[0], after, 1e-15) << gamma << " " << epsilon;
      ASSERT_NEAR(out.Lambda[0] * G(0, 0), after - gamma, 4e-15) << gamma << " " << epsilon;
      ASSERT_GE(out.gamma_plus[0], 0.0);
      ASSERT_GE(out.Lambda[0], 0.0);
    }
  }
}

TEST(OneContact, WithoutMobilityHasNoSolution) {
  for (const ImpactLaw law : laws) {
    ContactVector Lambda, gamma_plus;
    EXPECT_EQ(
        impact(law, MatrixXd::Zero(1, 1), numbers({0.5}), numbers({-1.0}), Lambda, gamma_plus),
        Solved::dependent);
  }
}

/// A random machine at an impact, with quantities around 1.
struct Problem {
  explicit Problem(Random& random, int largest = 5) {
    const int n = random.integer(1, largest);
    const int f = n + random.integer(0, 2);
    M = random.positive_definite(f, 0.3, 3.0);
    do {
      W = random.matrix(f, n);
      G = delassus(M, W);
    } while (!(rcond(G) > 1e-4));
    u = random.vector(f);
    epsilon = VectorXd::Constant(n, random.uniform(0, 1));
  }

  void unlike(Random& random) {
    for (double& e : epsilon) e = random.uniform(0, 1);
  }

  Outcome operator()(ImpactLaw law) const { return impact_on(law, M, W, epsilon, u); }
  Eigen::Index contacts() const { return W.cols(); }

  MatrixXd M, W, G;
  VectorXd u, epsilon;
};

// Impulses are of the order of velocities over the smallest eigenvalue of G.
double scale(const Outcome& out) { return 1.0 + out.Lambda.maxCoeff(); }

// Both laws as inequalities, independent of the solver. Neither gains energy, Newton's with one
// restitution; without restitution pressed contacts stop exactly.
TEST(Impact, SatisfiesInequalitiesOfItsLaw) {
  Random random(21);
  int stopped = 0;
  for (int i = 0; i < repetitions(20000); ++i) {
    SCOPED_TRACE("seed 21, case " + std::to_string(i));
    Problem p(random);
    const bool unlike = random.chance(0.5);
    if (unlike) p.unlike(random);
    if (!unlike && random.chance(0.4)) p.epsilon.setConstant(random.integer(0, 1));
    const VectorXd gamma = p.W.transpose() * p.u;
    const double energy = kinetic_energy(p.M, p.u);
    const Outcome newton = p(ImpactLaw::newton);
    const Outcome poisson = p(ImpactLaw::poisson);
    for (const Outcome* out : {&newton, &poisson}) {
      ASSERT_LE(distance(out->gamma_plus, gamma + p.G * out->Lambda), 1e-12 * scale(*out));
      ASSERT_LE(distance(out->gamma_plus, p.W.transpose() * out->u_plus), 1e-12 * scale(*out));
      ASSERT_GE(out->Lambda.minCoeff(), 0.0);
      if (out == &newton && unlike) continue;
      ASSERT_LE(kinetic_energy(p.M, out->u_plus), energy + 1e-12 * scale(*out));
      if (!p.epsilon.isZero(0.0)) continue;
      ASSERT_GE(out->gamma_plus.minCoeff(), 0.0);
      for (Eigen::Index k = 0; k < p.contacts(); ++k) {
        if (!(out->Lambda[k] > 0.0)) continue;
        ++stopped;
        ASSERT_EQ(out->gamma_plus[k], 0.0);
      }
    }
    const VectorXd kinematic = newton.gamma_plus + p.epsilon.cwiseProduct(gamma);
    ASSERT_GE(kinematic.minCoeff(), -1e-15);
    ASSERT_LE(kinematic.cwiseProduct(newton.Lambda).maxCoeff(), 1e-14 * scale(newton));
    // Poisson's compression is Newton's law without restitution. The rest of the impulse is E
    // Lambda_C and the part nu that prevents penetration.
    const Outcome compression =
        impact_on(ImpactLaw::newton, p.G, VectorXd::Zero(p.contacts()), gamma);
    const VectorXd nu =
        poisson.Lambda - compression.Lambda - p.epsilon.cwiseProduct(compression.Lambda);
    ASSERT_GE(nu.minCoeff(), -1e-14 * scale(poisson));
    ASSERT_GE(poisson.gamma_plus.minCoeff(), 0.0);
    ASSERT_LE(nu.cwiseProduct(poisson.gamma_plus).cwiseAbs().maxCoeff(), 1e-13 * scale(poisson));
  }
  EXPECT_GT(stopped, repetitions(20000) / 10);
}

TEST(Impact, SeparatingContactHasNoImpulse) {
  Random random(24);
  for (int i = 0; i < repetitions(5000); ++i) {
    Problem p(random);
    const VectorXd gamma = p.W.transpose() * p.u;
    // All contacts separate: no impulse.
    const VectorXd separating = gamma.cwiseAbs() + VectorXd::Constant(p.contacts(), 0.01);
    for (const ImpactLaw law : laws) {
      const Outcome none = impact_on(law, p.G, p.epsilon, separating);
      ASSERT_EQ(none.Lambda, VectorXd::Zero(p.contacts()));
      ASSERT_LE(distance(none.gamma_plus, separating), 4e-16 * (1.0 + separating.maxCoeff()));
    }
    if (p.contacts() == 1) continue;
    // One contact separates so fast that the others cannot reverse it. It takes no impulse, and the
    // others behave as without it.
    VectorXd fast = gamma;
    fast[0] = 1e7;
    const Eigen::Index rest = p.contacts() - 1;
    for (const ImpactLaw law : laws) {
      const Outcome out = impact_on(law, p.G, p.epsilon, fast);
      const Outcome others =
          impact_on(law, p.G.bottomRightCorner(rest, rest), p.epsilon.tail(rest), gamma.tail(rest));
      ASSERT_EQ(out.Lambda[0], 0.0);
      ASSERT_LE(distance(out.Lambda.tail(rest), others.Lambda), 1e-12 * scale(others));
      ASSERT_LE(distance(out.gamma_plus.tail(rest), others.gamma_plus), 1e-12 * scale(others));
    }
  }
}

// Of the order of the contacts, of the scale of the velocities (a power of two rounds equally), and
// of the unit of a gap: w -> s w, gamma -> s gamma, Lambda -> Lambda / s, and the motion is the
// same.
TEST(Impact, DoesNotDependOnOrderScaleAndUnits) {
  Random random(25), changes(26);
  for (int i = 0; i < repetitions(10000); ++i) {
    SCOPED_TRACE("seed 25, case " + std::to_string(i));
    Problem p(random, 8);
    p.unlike(random);
    std::vector<Eigen::Index> order(static_cast<std::size_t>(p.contacts()));
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t k = order.size(); k > 1; --k) {
      const auto j = static_cast<std::size_t>(random.integer(0, static_cast<int>(k) - 1));
      std::swap(order[k - 1], order[j]);
    }
    Problem permuted = p, faster = p, other = p;
    permuted.W = p.W(Eigen::all, order);
    permuted.epsilon = p.epsilon(order);
    const bool binary = changes.chance(0.5);
    const double factor = binary ? 0x1p40 : changes.log_uniform(1e-9, 1e9);
    faster.u *= factor;
    const Eigen::Index k = changes.integer(0, static_cast<int>(p.contacts()) - 1);
    const double s = changes.log_uniform(1e-3, 1e3);
    other.W.col(k) *= s;
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      const Outcome reordered = permuted(law);
      ASSERT_LE(distance(out.Lambda(order), reordered.Lambda), 1e-12 * scale(out));
      ASSERT_LE(distance(out.gamma_plus(order), reordered.gamma_plus), 1e-12 * scale(out));
      const Outcome fast = faster(law);
      const double tolerance = binary ? 0.0 : 1e-12 * scale(out);
      ASSERT_LE(distance(fast.Lambda / factor, out.Lambda), tolerance);
      ASSERT_LE(distance(fast.gamma_plus / factor, out.gamma_plus), tolerance);
      Outcome scaled = other(law);
      ASSERT_LE(distance(scaled.u_plus, out.u_plus), 1e-11 * scale(out));
      scaled.Lambda[k] *= s;
      scaled.gamma_plus[k] /= s;
      ASSERT_LE(distance(scaled.Lambda, out.Lambda), 1e-11 * scale(out));
      ASSERT_LE(distance(scaled.gamma_plus, out.gamma_plus), 1e-11 * scale(out));
    }
  }
}

}  // namespace
}  // namespace sprag
