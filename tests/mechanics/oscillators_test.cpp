// Would catch a closed form of an oscillator that loses digits in any regime of damping.
#include "sprag/detail/mechanics/oscillators.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <utility>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using Real = long double;

struct Point {
  Real z, v;
};

// exp(A tau) (z, v, alpha) by scaling, Taylor series and squaring. It has no case distinction, so
// that it is accurate near critical damping as well.
Point by_matrix_exponential(Real delta, Real kappa, Real tau, Point x, Real alpha) {
  using Matrix3 = Eigen::Matrix<Real, 3, 3>;
  const Real w = std::max({std::sqrt(kappa), delta, std::numeric_limits<Real>::min()});
  Matrix3 A;  // of (w z, v, alpha / w)
  A << 0, w, 0, -kappa / w, -2 * delta, w, 0, 0, 0;
  A *= tau;
  int halvings = 0;
  for (Real norm = A.lpNorm<Eigen::Infinity>(); norm > 0.125L; norm /= 2) ++halvings;
  A /= std::ldexp(Real(1), halvings);
  Matrix3 term = Matrix3::Identity();
  Matrix3 sum = Matrix3::Identity();
  for (int j = 1; j <= 16; ++j) {
    term = term * A / static_cast<Real>(j);
    sum += term;
  }
  for (; halvings > 0; --halvings) sum = (sum * sum).eval();
  const Eigen::Matrix<Real, 3, 1> y = sum * Eigen::Matrix<Real, 3, 1>(w * x.z, x.v, alpha / w);
  return {y[0] / w, y[1]};
}

// The textbook solution with two different eigenvalues; it loses digits if they are close.
Point by_eigenvalues(Real delta, Real kappa, Real tau, Point x) {
  using Complex = std::complex<Real>;
  const Complex root = std::sqrt(Complex(delta * delta - kappa, 0));
  const Complex s1 = -delta - root;
  const Complex s2 = std::abs(s1) > 0 ? kappa / s1 : Complex(0);
  const Complex c1 = (x.v - s2 * x.z) / (s1 - s2);
  const Complex c2 = (s1 * x.z - x.v) / (s1 - s2);
  const Complex e1 = c1 * std::exp(s1 * tau);
  const Complex e2 = c2 * std::exp(s2 * tau);
  return {(e1 + e2).real(), (s1 * e1 + s2 * e2).real()};
}

Point exact(Real delta, Real kappa, Real tau, Point x) {
  const Real gap = std::abs(delta * delta - kappa);
  if (gap > 0.01L * std::max(kappa, delta * delta)) return by_eigenvalues(delta, kappa, tau, x);
  return by_matrix_exponential(delta, kappa, tau, x, 0);
}

Eigen::ArrayXd one(double value) { return Eigen::ArrayXd::Constant(1, value); }

Point propagate(double delta, double kappa, double alpha, double tau, Point x) {
  const Oscillators oscillators(one(delta), one(kappa));
  OscillatorState state{one(static_cast<double>(x.z)), one(static_cast<double>(x.v))};
  oscillators.propagate(state, one(alpha), tau, 0, 1, state);
  return {state.z[0], state.v[0]};
}

// Largest error of z and v in units of the expected rounding error: that of the initial state,
// times the phase error by the rounding of kappa.
double error_in_roundings(double delta, double kappa, double tau, Point start, Point computed,
                          Point truth) {
  const double w = std::sqrt(kappa);
  const double z0 = std::abs(static_cast<double>(start.z));
  const double v0 = std::abs(static_cast<double>(start.v));
  const double reach = std::min({tau, w > 0 ? 1 / w : tau, delta > 0 ? 1 / delta : tau});
  const double z_scale = (z0 + v0 * reach) * (1 + w * tau);
  const double v_scale = (v0 + w * z0) * (1 + w * tau);
  const auto roundings = [](Real difference, double scale) {
    return scale > 0 ? static_cast<double>(std::abs(difference)) / (machine_epsilon * scale)
                     : (difference == 0 ? 0.0 : 1e300);
  };
  return std::max(roundings(computed.z - truth.z, z_scale),
                  roundings(computed.v - truth.v, v_scale));
}

enum class Regime { undamped, under, critical, over, near_critical };

struct Case {
  double delta, kappa, tau;
  Point start;
};

Case random_case(Random& random, Regime regime) {
  // Powers of two make delta^2 = kappa exactly.
  const double w = regime == Regime::critical ? std::exp2(random.integer(-10, 12))
                                              : random.log_uniform(1e-3, 4e3);
  double ratio = 0.0;
  switch (regime) {
    case Regime::undamped:
      ratio = 0.0;
      break;
    case Regime::under:
      ratio = random.log_uniform(1e-8, 0.99);
      break;
    case Regime::critical:
      ratio = 1.0;
      break;
    case Regime::over:
      ratio = random.log_uniform(1.01, 1e6);
      break;
    case Regime::near_critical:
      ratio = 1.0 + (random.chance(0.5) ? 1 : -1) * random.log_uniform(1e-16, 1e-2);
      break;
  }
  return {ratio * w,
          w * w,
          random.log_uniform(1e-6, 1e3) / w,
          {random.uniform(-1, 1), random.uniform(-1, 1) * w}};
}

class OscillatorRegimes : public testing::TestWithParam<Regime> {};

TEST_P(OscillatorRegimes, AgreeWithExtendedPrecisionToAFewRoundings) {
  const std::uint64_t seed = 7001;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  double worst = 0.0;
  for (int i = 0; i < repetitions(20000); ++i) {
    const Case c = random_case(random, GetParam());
    const Point computed = propagate(c.delta, c.kappa, 0.0, c.tau, c.start);
    const Point truth = exact(c.delta, c.kappa, c.tau, c.start);
    const double error = error_in_roundings(c.delta, c.kappa, c.tau, c.start, computed, truth);
    worst = std::max(worst, error);
    ASSERT_LT(error, 6.0) << "delta " << c.delta << ", kappa " << c.kappa << ", tau " << c.tau;
  }
  RecordProperty("worst_in_roundings", std::to_string(worst));
}

TEST_P(OscillatorRegimes, TickTableEqualsPropagate) {
  const std::uint64_t seed = 7003;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  for (int i = 0; i < repetitions(5000); ++i) {
    const Case c = random_case(random, GetParam());
    const Oscillators oscillators(one(c.delta), one(c.kappa));
    const TickTable table(oscillators, c.tau);
    OscillatorState state{one(static_cast<double>(c.start.z)), one(static_cast<double>(c.start.v))};
    table.rotate(state);
    const Point moved = propagate(c.delta, c.kappa, 0.0, c.tau, c.start);
    ASSERT_LT(error_in_roundings(c.delta, c.kappa, c.tau, c.start, {state.z[0], state.v[0]}, moved),
              8.0)
        << "delta " << c.delta << ", kappa " << c.kappa << ", tau " << c.tau;
  }
}

// A small number of oscillators uses another table than a large one.
TEST_P(OscillatorRegimes, TickTableMovesEachOscillatorIndependently) {
  const std::uint64_t seed = 7005;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  for (const Eigen::Index n : {2, 3, 15, 16, 17, 40}) {
    Eigen::ArrayXd delta(n), kappa(n);
    OscillatorState state{Eigen::ArrayXd(n), Eigen::ArrayXd(n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const Case c = random_case(random, GetParam());
      delta[i] = c.delta;
      kappa[i] = c.kappa;
      state.z[i] = static_cast<double>(c.start.z);
      state.v[i] = static_cast<double>(c.start.v);
    }
    const OscillatorState start = state;
    const double tau = random.uniform(0.0, 1.0);
    TickTable(Oscillators(delta, kappa), tau).rotate(state);
    for (Eigen::Index i = 0; i < n; ++i) {
      OscillatorState alone{one(start.z[i]), one(start.v[i])};
      TickTable(Oscillators(one(delta[i]), one(kappa[i])), tau).rotate(alone);
      EXPECT_EQ(state.z[i], alone.z[0]) << i << " of " << n;
      EXPECT_EQ(state.v[i], alone.v[0]) << i << " of " << n;
    }
  }
}

std::string regime_name(const testing::TestParamInfo<Regime>& regime) {
  constexpr std::array names{"Undamped", "Under", "Critical", "Over", "NearCritical"};
  return names[static_cast<std::size_t>(regime.param)];
}

INSTANTIATE_TEST_SUITE_P(All, OscillatorRegimes,
                         testing::Values(Regime::undamped, Regime::under, Regime::critical,
                                         Regime::over, Regime::near_critical),
                         regime_name);

TEST(Oscillators, FreeFallIsAParabola) {
  for (const double tau : {0.0, 1e-9, 0.25, 1.0, 1e4}) {
    const Point x = propagate(0.0, 0.0, -9.81, tau, {0.9, 0.5});
    const Real t = tau;
    const Real z = 0.9 + 0.5L * t + 0.5L * Real(-9.81) * t * t;
    const Real v = 0.5L + Real(-9.81) * t;
    EXPECT_NEAR(static_cast<double>(x.z - z), 0.0,
                2 * machine_epsilon * static_cast<double>(1 + std::abs(z)));
    EXPECT_NEAR(static_cast<double>(x.v - v), 0.0,
                2 * machine_epsilon * static_cast<double>(1 + std::abs(v)));
  }
}

// phi_1 = (1 - e^-x) / x, phi_2 = (x - 1 + e^-x) / x^2 by series or directly.
std::pair<Real, Real> drift_functions(Real x) {
  if (std::abs(x) >= 1) {
    const Real phi_1 = -std::expm1(-x) / x;
    return {phi_1, (1 - phi_1) / x};
  }
  Real term = 0.5L, phi_2 = 0;
  for (int j = 3; j < 30; ++j) {
    phi_2 += term;
    term *= -x / static_cast<Real>(j);
  }
  return {1 - x * phi_2, phi_2};
}

// Without stiffness: z'' + 2 delta z' = alpha, from hardly damped (x = 2 delta tau tiny) to the
// final speed alpha / (2 delta).
TEST(Oscillators, DampedDriftAgreesWithItsSeries) {
  const std::uint64_t seed = 7004;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  for (int i = 0; i < repetitions(20000); ++i) {
    const double delta = random.log_uniform(1e-6, 1e3);
    const double tau = random.log_uniform(1e-12, 1e3) / (2 * delta);
    const Real x = 2 * Real(delta) * tau;
    const auto [phi_1, phi_2] = drift_functions(x);
    const double z0 = random.uniform(-1, 1);
    const double v0 = random.uniform(-1, 1);
    const double alpha = random.uniform(-10, 10);
    const Point moved = propagate(delta, 0.0, alpha, tau, {z0, v0});
    const Real t = tau;
    const Real z = z0 + v0 * t * phi_1 + alpha * t * t * phi_2;
    const Real v = v0 * std::exp(-x) + alpha * t * phi_1;
    const double z_scale = std::abs(z0) + std::abs(v0) * static_cast<double>(t * phi_1) +
                           std::abs(alpha) * static_cast<double>(t * t * phi_2);
    const double v_scale = std::abs(v0) + std::abs(alpha) * static_cast<double>(t * phi_1);
    ASSERT_LT(static_cast<double>(std::abs(moved.z - z)), 16 * machine_epsilon * z_scale)
        << "delta " << delta << ", tau " << tau;
    ASSERT_LT(static_cast<double>(std::abs(moved.v - v)), 4 * machine_epsilon * v_scale)
        << "delta " << delta << ", tau " << tau;

    const TickTable table(Oscillators(one(delta), one(0.0)), tau);
    OscillatorState state{one(z0), one(v0)};
    table.rotate(state);
    table.push(one(alpha), state);
    EXPECT_NEAR(state.z[0], static_cast<double>(moved.z), 16 * machine_epsilon * z_scale);
    EXPECT_NEAR(state.v[0], static_cast<double>(moved.v), 8 * machine_epsilon * v_scale);
  }
}

// The neighbour of an undamped machine in a difference quotient may have negative damping.
TEST(Oscillators, NegativeDampingGrows) {
  for (const double delta : {-1e-9, -1e-5, -0.3, -2.0}) {
    for (const double tau : {0.0, 0.3, 2.0}) {
      const Real t = tau, x = 2 * Real(delta) * t;
      const auto [phi_1, phi_2] = drift_functions(x);
      const Point moved = propagate(delta, 0.0, -9.81, tau, {0.9, 0.5});
      const Real z = 0.9L + 0.5L * t * phi_1 - 9.81L * t * t * phi_2;
      const Real v = 0.5L * std::exp(-x) - 9.81L * t * phi_1;
      const double grown = static_cast<double>(std::exp(-x));
      EXPECT_NEAR(static_cast<double>(moved.z - z), 0.0, 1e-13 * grown) << delta << ' ' << tau;
      EXPECT_NEAR(static_cast<double>(moved.v - v), 0.0, 1e-13 * grown) << delta << ' ' << tau;
    }
  }
}

// Backwards over many decay times, in one step and in short steps: growing terms grow equally.
TEST(Oscillators, LongBackwardStepEqualsManyShortOnes) {
  constexpr int steps = 256;
  for (const double delta : {0.5, 2.0, 3.5, 8.0, 16.0}) {
    for (const double share : {0.0, 1e-9, 1e-3, 0.5, 0.999, 1.0, 1.001, 3.0, 40.0}) {
      const double kappa = share * delta * delta;
      const Point whole = propagate(delta, kappa, 1.0, -1.0, {0.0, 0.0});
      Point often{0.0, 0.0};
      for (int i = 0; i < steps; ++i) {
        often = propagate(delta, kappa, 1.0, -1.0 / steps, often);
      }
      const double scale = std::hypot(static_cast<double>(often.z), static_cast<double>(often.v));
      EXPECT_NEAR(static_cast<double>(whole.z), static_cast<double>(often.z), 1e-12 * scale)
          << "delta " << delta << ", kappa " << kappa;
      EXPECT_NEAR(static_cast<double>(whole.v), static_cast<double>(often.v), 1e-12 * scale)
          << "delta " << delta << ", kappa " << kappa;
    }
  }
}

TEST(Oscillators, BankMovesOnlySelectedOscillators) {
  const std::uint64_t seed = 7006;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  const Eigen::Index n = 12;
  // Neighbours with equal damping, in mixed regimes.
  Eigen::ArrayXd delta(n);
  Eigen::ArrayXd kappa(n);
  Eigen::ArrayXd alpha = Eigen::ArrayXd::Zero(n);
  delta << 0.0, 0.0, 0.085, 0.085, 0.085, 2.0, 2.0, 0.0, 0.085, 3.0, 3.0, 0.0;
  kappa << 9.0, 0.0, 12.0, 1e4, 0.0, 4.0, 4.0, 0.0, 0.001, 0.0, 1.0, 50.0;
  alpha[1] = 0.3;
  alpha[4] = -0.2;
  alpha[9] = 1.5;
  const Oscillators bank(delta, kappa);
  const OscillatorState start{random.vector(n).array(), random.vector(n).array()};
  OscillatorState to = start;
  bank.propagate(start, alpha, 0.73, 2, 8, to);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i < 2 || i >= 10) {
      EXPECT_EQ(to.z[i], start.z[i]);
      EXPECT_EQ(to.v[i], start.v[i]);
      continue;
    }
    const Point alone = propagate(delta[i], kappa[i], alpha[i], 0.73, {start.z[i], start.v[i]});
    EXPECT_EQ(to.z[i], static_cast<double>(alone.z)) << "i " << i;
    EXPECT_EQ(to.v[i], static_cast<double>(alone.v)) << "i " << i;
  }
  OscillatorState in_place = start;
  bank.propagate(in_place, alpha, 0.73, 0, n, in_place);
  OscillatorState copied = start;
  bank.propagate(start, alpha, 0.73, 0, n, copied);
  EXPECT_TRUE((in_place.z == copied.z).all() && (in_place.v == copied.v).all());
}

}  // namespace
}  // namespace sprag
