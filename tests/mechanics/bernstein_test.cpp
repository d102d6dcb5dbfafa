// Would catch a lower bound of a polynomial's first root that lies after the root, and a root that
// is reported where the polynomial has none.
#include "sprag/detail/mechanics/bernstein.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <numbers>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using bernstein::Coefficients;
using bernstein::degree;
using bernstein::Piece;

constexpr std::size_t top = degree;

// The exact value of the polynomial, in extended precision.
long double horner(const Coefficients& a, double s) {
  long double value = 0.0L;
  for (std::size_t j = top + 1; j-- > 0;) value = value * s + a[j];
  return value;
}

long double de_casteljau(const Coefficients& b, long double s) {
  std::array<long double, top + 1> p{};
  std::copy(b.begin(), b.end(), p.begin());
  for (std::size_t level = top; level > 0; --level) {
    for (std::size_t i = 0; i < level; ++i) p[i] += s * (p[i + 1] - p[i]);
  }
  return p[0];
}

double largest(const Coefficients& c) {
  double most = 0.0;
  for (const double x : c) most = std::max(most, std::abs(x));
  return most;
}

Coefficients random_coefficients(Random& random) {
  Coefficients c{};
  const double size = random.log_uniform(1e-9, 1e9);
  for (double& x : c) x = random.chance(0.1) ? 0.0 : size * random.uniform(-1.0, 1.0);
  return c;
}

// Positive at 0, often for a while; some are never negative.
Coefficients random_falling(Random& random) {
  Coefficients b = random_coefficients(random);
  const double low = random.uniform(-1.0, 0.2) * largest(b);
  for (double& x : b) x = std::max(x, low);
  b[0] = std::max(std::abs(b[0]), random.log_uniform(1e-6, 1.0) * (largest(b) + 1e-9));
  return b;
}

class Bernstein : public testing::Test {
 protected:
  static constexpr std::uint64_t seed = 20141;
  Bernstein() { std::cout << "seed " << seed << "\n"; }
  Random random_{seed};
};

TEST_F(Bernstein, CoefficientsOfPowersAreQuotientsOfBinomials) {
  const auto binomial = [](std::size_t n, std::size_t k) {
    return std::round(std::tgamma(static_cast<double>(n) + 1.0) /
                      std::tgamma(static_cast<double>(k) + 1.0) /
                      std::tgamma(static_cast<double>(n - k) + 1.0));
  };
  for (std::size_t k = 0; k <= top; ++k) {
    Coefficients power{};
    power[k] = 1.0;
    const Coefficients b = bernstein::from_power(power);
    for (std::size_t i = 0; i <= top; ++i) {
      EXPECT_DOUBLE_EQ(b[i], i < k ? 0.0 : binomial(i, k) / binomial(top, k)) << i << ", " << k;
    }
  }
}

TEST_F(Bernstein, FormIsThePolynomialAndEnclosesIt) {
  for (int i = 0; i < repetitions(2000); ++i) {
    const Coefficients a = random_coefficients(random_);
    const Coefficients b = bernstein::from_power(a);
    double sum = 0.0;
    for (const double x : a) sum += x;
    ASSERT_EQ(b[0], a[0]);
    ASSERT_EQ(b[top], sum);
    const double rounding = 16.0 * machine_epsilon * largest(a);
    const auto [low, high] = std::minmax_element(b.begin(), b.end());
    for (int k = 0; k <= 20; ++k) {
      const double s = k / 20.0;
      const auto value = static_cast<double>(horner(a, s));
      ASSERT_NEAR(static_cast<double>(de_casteljau(b, s)), value, rounding) << i;
      ASSERT_GE(value, *low - rounding) << i;
      ASSERT_LE(value, *high + rounding) << i;
    }
  }
}

TEST_F(Bernstein, SplitPartsEqualPolynomialAndMeetAndCutGivesTheRightOne) {
  for (int i = 0; i < repetitions(2000); ++i) {
    const Piece whole{random_coefficients(random_), random_.uniform(0.0, 0.5),
                      random_.log_uniform(1e-6, 0.5)};
    const double s = random_.log_uniform(1e-3, 1.0);
    Piece left = whole;
    Piece right{};
    bernstein::split(left, s, right);
    Piece cut = whole;
    bernstein::cut(cut, s);
    ASSERT_EQ(cut.b, right.b);
    ASSERT_EQ(cut.low, right.low);
    ASSERT_EQ(cut.length, right.length);
    ASSERT_EQ(left.b[0], whole.b[0]);
    ASSERT_EQ(left.b[top], right.b[0]);
    ASSERT_EQ(right.b[top], whole.b[top]);
    ASSERT_EQ(left.low, whole.low);
    ASSERT_DOUBLE_EQ(left.low + left.length, right.low);
    ASSERT_DOUBLE_EQ(right.low + right.length, whole.low + whole.length);
    const double rounding = 16.0 * machine_epsilon * largest(whole.b);
    for (int k = 0; k <= 10; ++k) {
      const long double x = k / 10.0L;
      ASSERT_NEAR(static_cast<double>(de_casteljau(left.b, x)),
                  static_cast<double>(de_casteljau(whole.b, s * x)), rounding);
      ASSERT_NEAR(static_cast<double>(de_casteljau(right.b, x)),
                  static_cast<double>(de_casteljau(whole.b, s + (1.0L - s) * x)), rounding);
    }
  }
}

// The hull consists of all segments from a positive control point to a later negative one.
TEST_F(Bernstein, HullCrossesZeroWhereTheFirstSegmentDoes) {
  int crossings = 0;
  for (int i = 0; i < repetitions(20000); ++i) {
    const Coefficients b = random_falling(random_);
    double first = infinity;
    for (std::size_t j = 0; j <= top; ++j) {
      for (std::size_t k = j + 1; k <= top; ++k) {
        if (b[j] < 0.0 || b[k] >= 0.0) continue;
        const double share = b[j] / (b[j] - b[k]);
        first =
            std::min(first, (static_cast<double>(j) + share * static_cast<double>(k - j)) / degree);
      }
    }
    const double crossing = bernstein::hull_crossing(b);
    if (first == infinity) {
      ASSERT_EQ(crossing, infinity) << i;
      continue;
    }
    ++crossings;
    ASSERT_NEAR(crossing, first, 8.0 * machine_epsilon) << i;
    for (int k = 0; k < 50; ++k) {
      ASSERT_GE(de_casteljau(b, crossing * k / 50.0), -16.0 * machine_epsilon * largest(b)) << i;
    }
  }
  EXPECT_GT(crossings, repetitions(20000) / 4);
  EXPECT_LT(crossings, repetitions(20000));
}

// No part with a root is certified as positive, and the result is a root or close to one.
TEST_F(Bernstein, FirstRootBoundsTheFirstRootOfAnyCoefficients) {
  int none = 0;
  int some = 0;
  for (int i = 0; i < repetitions(20000); ++i) {
    const Coefficients b = random_falling(random_);
    const double root = bernstein::first_root(b);
    const double rounding = 64.0 * machine_epsilon * largest(b);
    const double end = std::min(root, 1.0);
    for (int k = 0; k < 200; ++k) ASSERT_GE(de_casteljau(b, end * k / 200.0), -rounding) << i;
    ++(root == infinity ? none : some);
    if (root == infinity) continue;
    ASSERT_GT(root, 0.0) << i;
    ASSERT_LE(root, 1.0) << i;
    ASSERT_LE(de_casteljau(b, root), 1e-2 * b[0] + rounding) << i;
  }
  std::cout << some << " roots, " << none << " without\n";
  EXPECT_GT(some, repetitions(20000) / 10);
  EXPECT_GT(none, repetitions(20000) / 10);
}

TEST_F(Bernstein, IsInvariantUnderPowersOfTwo) {
  for (int i = 0; i < repetitions(2000); ++i) {
    Coefficients b = random_falling(random_);
    const double crossing = bernstein::hull_crossing(b);
    const double root = bernstein::first_root(b);
    const double scale = std::ldexp(1.0, random_.integer(-300, 300));
    for (double& x : b) x *= scale;
    ASSERT_EQ(bernstein::hull_crossing(b), crossing);
    ASSERT_EQ(bernstein::first_root(b), root);
  }
}

TEST_F(Bernstein, NonNegativeCoefficientsHaveNoRoot) {
  for (int i = 0; i < repetitions(2000); ++i) {
    Coefficients b = random_coefficients(random_);
    for (double& x : b) x = std::abs(x);
    b[0] += 1e-300;
    ASSERT_EQ(bernstein::hull_crossing(b), infinity);
    ASSERT_EQ(bernstein::first_root(b), infinity);
  }
  EXPECT_EQ(bernstein::first_root({1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}), infinity);
  EXPECT_EQ(bernstein::first_root({1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0}), infinity);
}

TEST_F(Bernstein, NegativeCoefficientAloneIsNotARoot) {
  const Coefficients b{1.0, 1.0, 1.0, -0.5, 1.0, 1.0, 1.0, 1.0};
  EXPECT_LT(bernstein::hull_crossing(b), 3.0 / 7.0);
  EXPECT_EQ(bernstein::first_root(b), infinity);
}

TEST_F(Bernstein, ShallowTouchIsReportedAsRoot) {
  // (s - 1/2)^2 + d relative to 1/4 + d at the start: one percent is the limit.
  for (const double d : {0.0, 1e-15, 1e-9, 1e-4}) {
    const double root = bernstein::first_root(bernstein::from_power({0.25 + d, -1.0, 1.0}));
    EXPECT_LE(root, 0.5) << d;
    EXPECT_GE(root, 0.45 - 1e-3) << d;
  }
  EXPECT_EQ(bernstein::first_root(bernstein::from_power({0.25 + 0.01, -1.0, 1.0})), infinity);
}

TEST_F(Bernstein, RootsAtBothEndsAreFound) {
  // With its only root at 1 it is positive before.
  EXPECT_EQ(bernstein::first_root(bernstein::from_power({1.0, -1.0})), infinity);
  const double last = bernstein::first_root(bernstein::from_power({1.0, -1.0 - 1e-12}));
  EXPECT_LE(last, 1.0);
  EXPECT_GE(last, 0.99);
  EXPECT_EQ(bernstein::first_root({1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1e-17}), 1.0);
  for (const double start : {1e-3, 1e-9, 1e-15, 1e-100, 1e-300}) {
    const double root = bernstein::first_root(bernstein::from_power({start, -1.0}));
    EXPECT_LE(root, start * (1.0 + 8.0 * machine_epsilon)) << start;
    EXPECT_GE(root, 0.98 * start) << start;
  }
}

TEST_F(Bernstein, FirstOfManyRootsIsFound) {
  // Chebyshev's polynomial T_7(1 - 2 s): all of its 7 roots are in (0, 1).
  const Coefficients b =
      bernstein::from_power({1.0, -98.0, 1568.0, -9408.0, 26880.0, -39424.0, 28672.0, -8192.0});
  const double first = (1.0 - std::cos(std::numbers::pi / 14.0)) / 2.0;
  const double root = bernstein::first_root(b);
  EXPECT_LE(root, first * (1.0 + 1e-12));
  EXPECT_GE(root, 0.98 * first);
}

}  // namespace
}  // namespace sprag
