// Two machines with the same impact from different velocities: whether their distance grows. An
// impact changes only the kinetic energy of their difference, |gamma_A - gamma_B|_(G^-1). The
// observer's convergence at impacts rests on these tests.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <ostream>
#include <string>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

constexpr int most = 4;  // contacts of an impact
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most, most>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1>;

// Velocities are around 1, the smallest distances near 1e-6.
constexpr double rounding = 1e-9;

/// n contacts of a machine: G = W^T M^-1 W in coordinates where M = 1.
Matrix random_G(Random& random, int n) {
  while (true) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most + 2, most> W(
        n + random.integer(0, 2), n);
    for (double& w : W.reshaped()) w = random.uniform(-1, 1);
    const Matrix G = W.transpose() * W;
    const CholeskyFactor factor(G);
    const Eigen::ArrayXd pivots = factor.L().diagonal().array().square();
    if (pivots.minCoeff() > 1e-3 * pivots.maxCoeff()) return G;
  }
}

Vector random_velocities(Random& random, int n) {
  Vector gamma(n);
  for (double& g : gamma) g = random.uniform(-1, 1);
  return gamma;
}

struct Machines {
  Matrix G;
  Vector epsilon, a, b;  // a and b: gamma- of the two
  Vector a_plus, b_plus;
  ContactSet closing = 0;  // of clutches: the others were closed before

  int contacts() const { return static_cast<int>(a.size()); }

  /// Distance after the impact over distance before it.
  double ratio(ImpactLaw law) {
    a_plus = after(law, a);
    b_plus = after(law, b);
    const CholeskyFactor factor(G);
    return factor.solve_L(a_plus - b_plus).norm() / factor.solve_L(a - b).norm();
  }

 private:
  Vector after(ImpactLaw law, const Vector& gamma_minus) const {
    ContactVector Lambda, gamma_plus;
    EXPECT_EQ(impact(law, G, epsilon, gamma_minus, Lambda, gamma_plus), Solved::yes);
    return gamma_plus;
  }
};

Machines random_machines(Random& random) {
  Machines machines;
  const int n = random.integer(1, most);
  machines.G = random_G(random, n);
  machines.epsilon = Vector::Constant(n, random.uniform(0, 1));
  machines.a = random_velocities(random, n);
  // Half of the pairs are close: the bound holds for every direction of the difference, too.
  const double apart = random.chance(0.5) ? 1.0 : random.log_uniform(1e-3, 1.0);
  machines.b = (1.0 - apart) * machines.a + apart * random_velocities(random, n);
  return machines;
}

Machines unlike_machines(Random& random) {
  Machines machines = random_machines(random);
  while (machines.contacts() < 2) machines = random_machines(random);
  for (double& e : machines.epsilon) e = random.uniform(0, 1);
  if (random.chance(0.3)) machines.epsilon[0] = 0.0;
  return machines;
}

double smallest_eigenvalue(const Matrix& A) { return eigenvalues(A)[0]; }

/// Positive: Newton's law is non-expansive. D = diag((1 - epsilon) / (1 + epsilon)).
double newton_margin(const Machines& m) {
  const Vector D = (1.0 - m.epsilon.array()) / (1.0 + m.epsilon.array());
  return smallest_eigenvalue(D.asDiagonal() * m.G + m.G * D.asDiagonal());
}

double poisson_margin(const Machines& m) {
  return smallest_eigenvalue(m.G - m.epsilon.asDiagonal() * m.G * m.epsilon.asDiagonal());
}

/// Master and replica at one instant. Some participating contacts were closed before: those of the
/// master stay at gamma = 0, the replica's clutch holds gamma >= 0. The others close now: in the
/// master they approach, in the replica they have any velocity.
Machines clutch_machines(Random& random) {
  Machines machines = random_machines(random);
  const int n = machines.contacts();
  machines.closing = bit(random.integer(0, n - 1));
  for (int i = 0; i < n; ++i) {
    if (random.chance(0.4)) machines.closing |= bit(i);
    if (contains(machines.closing, i)) {
      machines.a[i] = -std::abs(machines.a[i]);
    } else {
      machines.a[i] = 0.0;
      machines.b[i] = random.chance(0.5) ? 0.0 : std::abs(machines.b[i]);
    }
  }
  return machines;
}

/// A contact that stays closed after a chatter has gamma = 0 in the master, which then takes no
/// impulse. In the replica it takes restitution 0 while the others keep theirs. Although the
/// restitutions differ, an impact without energy gain cannot increase the distance from a machine
/// without an impulse.
Machines sustained_machines(Random& random) {
  Machines machines = clutch_machines(random);
  machines.a.setZero();
  for (int k = 0; k < machines.contacts(); ++k) {
    machines.epsilon[k] = contains(machines.closing, k) ? 0.0 : random.uniform(0, 1);
  }
  return machines;
}

/// Unlike restitutions with a positive margin.
template <double (*margin)(const Machines&)>
Machines admissible_machines(Random& random) {
  for (;;) {
    Machines machines = unlike_machines(random);
    if (margin(machines) >= 0.0) return machines;
  }
}

struct Trial {
  const char* name;
  ImpactLaw law;
  Machines (*draw)(Random&);
  std::uint64_t seed;
};
void PrintTo(const Trial& trial, std::ostream* out) { *out << trial.name; }

class ImpactDistance : public testing::TestWithParam<Trial> {};
INSTANTIATE_TEST_SUITE_P(
    Trials, ImpactDistance,
    testing::Values(
        Trial{"PoissonCommon", ImpactLaw::poisson, random_machines, 201},
        Trial{"NewtonCommon", ImpactLaw::newton, random_machines, 201},
        Trial{"PulseAtClutches", ImpactLaw::poisson, clutch_machines, 203},
        Trial{"SustainedClosing", ImpactLaw::poisson, sustained_machines, 204},
        Trial{"NewtonUnlike", ImpactLaw::newton, admissible_machines<newton_margin>, 207},
        Trial{"PoissonUnlike", ImpactLaw::poisson, admissible_machines<poisson_margin>, 209}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_P(ImpactDistance, DoesNotGrow) {
  Random random(GetParam().seed);
  const int cases = long_repetitions(200000);
  double largest = 0.0;
  for (int i = 0; i < cases; ++i) {
    Machines machines = GetParam().draw(random);
    const double ratio = machines.ratio(GetParam().law);
    largest = std::max(largest, ratio);
    ASSERT_LE(ratio - 1.0, rounding) << "seed " << GetParam().seed << ", case " << i;
  }
  std::printf("%d cases, largest ratio %.12f\n", cases, largest);
}

class CommonRestitution : public testing::TestWithParam<ImpactLaw> {};
INSTANTIATE_TEST_SUITE_P(Laws, CommonRestitution,
                         testing::Values(ImpactLaw::poisson, ImpactLaw::newton),
                         [](const auto& parameter) {
                           return std::string(parameter.param == ImpactLaw::poisson ? "Poisson"
                                                                                    : "Newton");
                         });

// With restitution 1 the distance is preserved: the bound is attained.
TEST_P(CommonRestitution, ElasticImpactsPreserveDistance) {
  Random random(202);
  int kept = 0;
  for (int i = 0; i < repetitions(1000); ++i) {
    Machines machines = random_machines(random);
    const int n = machines.contacts();
    machines.epsilon.setOnes();
    const auto pressed = [&] { return Vector(random_velocities(random, n).cwiseAbs()); };
    machines.a = -machines.G * pressed();
    machines.b = -machines.G * pressed();
    // Poisson's law stops a contact that separated before.
    const bool separates = machines.a.maxCoeff() > 0.0 || machines.b.maxCoeff() > 0.0;
    if (GetParam() == ImpactLaw::poisson && separates) continue;
    ++kept;
    ASSERT_NEAR(machines.ratio(GetParam()), 1.0, rounding) << "case " << i;
  }
  EXPECT_GT(kept, repetitions(1000) / 3);
}

// A replica's effective restitution: the remaining approach velocity is at most its share, and a
// contact that does not approach before does not approach afterwards.
TEST_P(CommonRestitution, NegativeRestitutionIsNonexpansive) {
  const std::uint64_t seed = 206;
  Random random(seed);
  const int cases = long_repetitions(60000);
  for (int i = 0; i < cases; ++i) {
    Machines machines = random_machines(random);
    machines.epsilon *= -1.0;
    ASSERT_LE(machines.ratio(GetParam()) - 1.0, rounding) << "seed " << seed << ", case " << i;
    const Vector remains = -machines.epsilon.cwiseProduct(machines.a.cwiseMin(0.0));
    ASSERT_GE((machines.a_plus - remains).minCoeff(), -rounding) << "case " << i;
    // Both laws agree then.
    const Vector by_this_law = machines.a_plus;
    machines.ratio(GetParam() == ImpactLaw::newton ? ImpactLaw::poisson : ImpactLaw::newton);
    ASSERT_LE((machines.a_plus - by_this_law).norm(), rounding) << "case " << i;
  }
}

TEST(NegativeRestitution, LeavesGivenShareOfApproachVelocity) {
  for (const ImpactLaw law : {ImpactLaw::poisson, ImpactLaw::newton}) {
    ContactMatrix G(1, 1);
    G << 2.0;
    ContactVector epsilon(1), gamma(1), Lambda, gamma_plus;
    epsilon << -0.25;
    gamma << -3.0;
    ASSERT_EQ(impact(law, G, epsilon, gamma, Lambda, gamma_plus), Solved::yes);
    EXPECT_DOUBLE_EQ(gamma_plus[0], -0.75);
    EXPECT_DOUBLE_EQ(Lambda[0], 0.75 * 3.0 / 2.0);
    gamma << 3.0;
    ASSERT_EQ(impact(law, G, epsilon, gamma, Lambda, gamma_plus), Solved::yes);
    EXPECT_EQ(gamma_plus[0], 3.0);
    EXPECT_EQ(Lambda[0], 0.0);
  }
}

// The smallest cases, by hand, epsilon = (0, 1), compressions Lambda_C > 0. With G_12 = -0.8 the
// second contact's expansion pulls the first, whose nu leaves gamma+ = (0, 0.36 Lambda_C2). With
// G_12 = 0.8 it does not, gamma+ = Lambda_C2 (0.8, 1), and compressions that differ by (-0.1, 0.08)
// increase the distance of the machines from 0.06 to 0.08.
TEST(UnlikeRestitution, PoissonByHand) {
  Machines machines;
  machines.G.resize(2, 2);
  machines.G << 1.0, -0.8, -0.8, 1.0;
  machines.epsilon = Eigen::Vector2d(0.0, 1.0);
  machines.a = -machines.G * Eigen::Vector2d(1.0, 1.0);
  machines.b = -machines.G * Eigen::Vector2d(1.0, 1.1);
  EXPECT_NEAR(machines.ratio(ImpactLaw::poisson), 0.6, 1e-14);
  EXPECT_LE((machines.a_plus - Eigen::Vector2d(0.0, 0.36)).norm(), 1e-15);
  EXPECT_LE((machines.b_plus - Eigen::Vector2d(0.0, 0.396)).norm(), 1e-15);
  machines.G << 1.0, 0.8, 0.8, 1.0;
  machines.a = -machines.G * Eigen::Vector2d(1.0, 1.0);
  machines.b = -machines.G * Eigen::Vector2d(0.9, 1.08);
  EXPECT_NEAR(machines.ratio(ImpactLaw::poisson), 0.08 / 0.06, 1e-12);
}

}  // namespace
}  // namespace sprag
