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
// impulse of the first pushes it back.
class TwoContacts : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    MatrixXd W0(2, 2);
    W0 << 1.0, -0.8, 0.0, 0.6;
    M = MatrixXd::Identity(2, 2);
    if (GetParam()) M << 2.0, 0.6, 0.6, 0.5;
    W = product(CholeskyFactor(M).L(), W0);
    u = inverse(MatrixXd(W.transpose())) * numbers({-1.0, 0.3});
  }

  MatrixXd M, W;
  VectorXd u;
};
INSTANTIATE_TEST_SUITE_P(Masses, TwoContacts, testing::Values(false, true),
                         [](const auto& parameter) {
                           return std::string(parameter.param ? "Coupled" : "Unit");
                         });

TEST_P(TwoContacts, NewtonLetsTheSecondContactApproachAfterwards) {
  const Outcome out = impact_on(ImpactLaw::newton, M, W, numbers({0.7, 0.7}), u);
  EXPECT_LE(distance(out.gamma_plus, numbers({0.7, -0.21})), 1e-14);
  // Lambda = 1.7 (0.76, 0.5) / 0.36
  EXPECT_LE(distance(out.Lambda, numbers({1.7 * 0.76 / 0.36, 1.7 * 0.5 / 0.36})), 1e-13);
  EXPECT_LE(distance(W.transpose() * out.u_plus, out.gamma_plus), 1e-14);
  EXPECT_NEAR(kinetic_energy(M, out.u_plus), 0.49 * kinetic_energy(M, u), 1e-14);
}

TEST_P(TwoContacts, PoissonStopsTheSecondContact) {
  const Outcome out = impact_on(ImpactLaw::poisson, M, W, numbers({0.7, 0.7}), u);
  EXPECT_LE(distance(out.gamma_plus, numbers({0.532, 0.0})), 1e-14);
  EXPECT_EQ(out.gamma_plus[1], 0.0);
  // Compression Lambda_C = (0.76, 0.5) / 0.36, expansion 0.7 Lambda_C and nu_2 = 0.21.
  EXPECT_LE(distance(out.Lambda, numbers({1.7 * 0.76 / 0.36, 1.7 * 0.5 / 0.36 + 0.21})), 1e-13);
  EXPECT_LE(distance(W.transpose() * out.u_plus, out.gamma_plus), 1e-14);
  EXPECT_LT(kinetic_energy(M, out.u_plus), kinetic_energy(M, u));
}

TEST_P(TwoContacts, UnlikeRestitution) {
  // Newton: gamma+ = -E gamma- with both contacts pressed.
  const Outcome newton = impact_on(ImpactLaw::newton, M, W, numbers({0.7, 0.2}), u);
  EXPECT_LE(distance(newton.gamma_plus, numbers({0.7, -0.06})), 1e-14);
  EXPECT_LE(distance(newton.Lambda, numbers({1.412 / 0.36, 1.0 / 0.36})), 1e-13);

  // Poisson: expansion (0.532, 0.1) / 0.36 gives G (.) = (1.2555.., -0.9044..), nu_2 = 0.9044..
  const double nu = (0.8 * 0.532 - 0.1) / 0.36;
  const Outcome poisson = impact_on(ImpactLaw::poisson, M, W, numbers({0.7, 0.2}), u);
  EXPECT_LE(distance(poisson.gamma_plus, numbers({0.532, 0.0})), 1e-14);
  EXPECT_LE(distance(poisson.Lambda, numbers({1.292 / 0.36, 0.6 / 0.36 + nu})), 1e-13);

  // In the opposite case the second contact expands more than the first and leaves with 0.38.
  const Outcome turned = impact_on(ImpactLaw::poisson, M, W, numbers({0.0, 1.0}), u);
  const double nu_1 = 0.8 * 0.5 / 0.36;
  EXPECT_LE(distance(turned.gamma_plus, numbers({0.0, 0.5 / 0.36 - 0.8 * nu_1})), 1e-14);
  EXPECT_LE(distance(turned.Lambda, numbers({0.76 / 0.36 + nu_1, 1.0 / 0.36})), 1e-13);
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

// Both laws as inequalities, independent of the solver.
TEST(Impact, SatisfiesInequalitiesOfItsLaw) {
  Random random(21);
  for (int i = 0; i < repetitions(20000); ++i) {
    SCOPED_TRACE("seed 21, case " + std::to_string(i));
    Problem p(random);
    p.unlike(random);
    const VectorXd gamma = p.W.transpose() * p.u;
    const Outcome newton = p(ImpactLaw::newton);
    const Outcome poisson = p(ImpactLaw::poisson);
    for (const Outcome* out : {&newton, &poisson}) {
      ASSERT_LE(distance(out->gamma_plus, gamma + p.G * out->Lambda), 1e-12 * scale(*out));
      ASSERT_LE(distance(out->gamma_plus, p.W.transpose() * out->u_plus), 1e-12 * scale(*out));
      ASSERT_GE(out->Lambda.minCoeff(), 0.0);
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
}

TEST(Impact, WithoutRestitutionPressedContactsStop) {
  Random random(22);
  int pressed = 0;
  for (int i = 0; i < repetitions(20000); ++i) {
    Problem p(random);
    p.epsilon.setZero();
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      ASSERT_GE(out.gamma_plus.minCoeff(), 0.0);
      for (Eigen::Index k = 0; k < p.contacts(); ++k) {
        if (!(out.Lambda[k] > 0.0)) continue;
        ++pressed;
        ASSERT_EQ(out.gamma_plus[k], 0.0) << "case " << i;
      }
    }
  }
  EXPECT_GT(pressed, repetitions(20000));
}

TEST(Impact, NeverGainsEnergy) {
  Random random(23);
  for (int i = 0; i < repetitions(20000); ++i) {
    Problem p(random);
    if (random.chance(0.2)) p.epsilon.setOnes();
    const double before = kinetic_energy(p.M, p.u);
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      ASSERT_LE(kinetic_energy(p.M, out.u_plus), before + 1e-12 * scale(out)) << "case " << i;
    }
    // Poisson is dissipative for any restitution.
    p.unlike(random);
    const Outcome out = p(ImpactLaw::poisson);
    ASSERT_LE(kinetic_energy(p.M, out.u_plus), before + 1e-12 * scale(out)) << "case " << i;
  }
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

TEST(Impact, DoesNotDependOnTheOrderOfTheContacts) {
  Random random(25);
  for (int i = 0; i < repetitions(10000); ++i) {
    Problem p(random, 8);
    p.unlike(random);
    std::vector<Eigen::Index> order(static_cast<std::size_t>(p.contacts()));
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t k = order.size(); k > 1; --k) {
      const auto j = static_cast<std::size_t>(random.integer(0, static_cast<int>(k) - 1));
      std::swap(order[k - 1], order[j]);
    }
    Problem permuted = p;
    permuted.W = p.W(Eigen::all, order);
    permuted.epsilon = p.epsilon(order);
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      const Outcome other = permuted(law);
      ASSERT_LE(distance(out.Lambda(order), other.Lambda), 1e-12 * scale(out)) << "case " << i;
      ASSERT_LE(distance(out.gamma_plus(order), other.gamma_plus), 1e-12 * scale(out));
    }
  }
}

TEST(Impact, ScalesWithTheVelocities) {
  Random random(26);
  for (int i = 0; i < repetitions(10000); ++i) {
    Problem p(random, 8);
    p.unlike(random);
    Problem faster = p;
    // A power of two rounds equally, another factor nearly so.
    const bool binary = random.chance(0.5);
    const double factor = binary ? 0x1p40 : random.log_uniform(1e-9, 1e9);
    faster.u *= factor;
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      const Outcome scaled = faster(law);
      const double tolerance = binary ? 0.0 : 1e-12 * scale(out);
      ASSERT_LE(distance(scaled.Lambda / factor, out.Lambda), tolerance) << "case " << i;
      ASSERT_LE(distance(scaled.gamma_plus / factor, out.gamma_plus), tolerance);
    }
  }
}

// The unit of a contact's gap is arbitrary: w -> s w, gamma -> s gamma, Lambda -> Lambda / s, and
// the motion is the same.
TEST(Impact, DoesNotDependOnTheUnitOfAGap) {
  Random random(27);
  for (int i = 0; i < repetitions(10000); ++i) {
    Problem p(random, 8);
    p.unlike(random);
    Problem other = p;
    const Eigen::Index k = random.integer(0, static_cast<int>(p.contacts()) - 1);
    const double s = random.log_uniform(1e-3, 1e3);
    other.W.col(k) *= s;
    for (const ImpactLaw law : laws) {
      const Outcome out = p(law);
      Outcome scaled = other(law);
      ASSERT_LE(distance(scaled.u_plus, out.u_plus), 1e-11 * scale(out)) << "case " << i;
      scaled.Lambda[k] *= s;
      scaled.gamma_plus[k] /= s;
      ASSERT_LE(distance(scaled.Lambda, out.Lambda), 1e-11 * scale(out)) << "case " << i;
      ASSERT_LE(distance(scaled.gamma_plus, out.gamma_plus), 1e-11 * scale(out));
    }
  }
}

}  // namespace
}  // namespace sprag
