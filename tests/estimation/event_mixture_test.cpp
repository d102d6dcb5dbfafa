#include "sprag/estimation/event_mixture.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <iostream>
#include <vector>

#include "tests/support/random.h"

namespace sprag {
namespace {

// Of y = -gamma > 0 with the density y N(y; a, 1), by Simpson's rule in long double.
FluxMoments by_quadrature(double a) {
  using Real = long double;
  const Real peak = (a + std::sqrt(Real(a) * a + 4)) / 2;
  const auto log_density = [&](Real y) { return std::log(y) - (y - a) * (y - a) / 2; };
  const Real low = std::max<Real>(0, peak - 14);
  const Real high = peak + 14;
  constexpr int n = 200000;
  Real sums[3] = {0, 0, 0};
  for (int i = 1; i <= n; ++i) {
    const Real y = low + (high - low) * i / n;
    const Real weight = (i == n       ? 1
                         : i % 2 == 1 ? 4
                                      : 2) *
                        std::exp(log_density(y) - log_density(peak)) * (high - low) / (3 * n);
    sums[0] += weight;
    sums[1] += weight * y;
    sums[2] += weight * y * y;
  }
  const Real mean = sums[1] / sums[0];
  const Real log_total = std::log(sums[0]) + log_density(peak) - 0.918938533204672741780329736406L;
  return {static_cast<double>(log_total), static_cast<double>(-mean),
          static_cast<double>(sums[2] / sums[0] - mean * mean)};
}

TEST(FluxMoments, AreThoseOfTheDensity) {
  for (const double a : {-30.0, -8.5, -7.9, -3.0, -0.5, 0.0, 0.3, 2.0, 7.9, 8.1, 40.0}) {
    const FluxMoments expected = by_quadrature(a);
    for (const double d : {1e-9, 1.0, 1e6}) {
      const FluxMoments moments = flux_moments(-a * d, d);
      const double tolerance = a < -8.0 ? 1e-3 : 1e-8;
      EXPECT_NEAR(moments.log_weight - std::log(d), expected.log_weight, tolerance) << a;
      EXPECT_NEAR(moments.mean / d / expected.mean, 1.0, tolerance) << a;
      EXPECT_NEAR(moments.variance / (d * d) / expected.variance, 1.0, 10.0 * tolerance) << a;
    }
  }
}

TEST(NormalDistribution, HasNoOverflowAnywhere) {
  for (const double x : {-1e6, -40.0, -8.1, -7.9, -1.0, 0.0, 3.0, 40.0}) {
    EXPECT_TRUE(std::isfinite(log_normal_cdf(x))) << x;
    EXPECT_TRUE(std::isfinite(normal_hazard(x))) << x;
  }
  for (const double x : {-8.1, -7.9, -1.0, 0.0, 3.0}) {
    const long double cdf = std::erfc(-static_cast<long double>(x) / std::sqrt(2.0L)) / 2;
    const long double density =
        std::exp(-static_cast<long double>(x) * x / 2 - 0.918938533204672741780329736406L);
    EXPECT_NEAR(log_normal_cdf(x) / static_cast<double>(std::log(cdf)), 1.0, 1e-4) << x;
    EXPECT_NEAR(normal_hazard(x) / static_cast<double>(density / cdf), 1.0, 1e-3) << x;
  }
}

struct Dense {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// The moments of the mixture with full matrices, one hypothesis after the other.
struct Mixed {
  Eigen::MatrixXd S;  // 2 f x c
  std::vector<EventMixture::Hypothesis> of;
  std::vector<Eigen::VectorXd> phi, psi, b;

  Dense moments(const Eigen::VectorXd& m) const {
    double total = 0.0;
    for (const auto& one : of) total += std::exp(one.log_weight);
    Dense all{Eigen::VectorXd::Zero(m.size()), Eigen::MatrixXd::Zero(m.size(), m.size())};
    std::vector<Dense> each;
    for (std::size_t j = 0; j < of.size(); ++j) {
      const auto& one = of[j];
      const Eigen::VectorXd k = one.shift_phi * phi[j] + one.shift_psi * psi[j];
      const Eigen::MatrixXd T = Eigen::MatrixXd::Identity(k.size(), k.size()) -
                                one.taken_along_phi * phi[j] * phi[j].transpose() -
                                one.taken_along_psi * psi[j] * psi[j].transpose();
      const Eigen::MatrixXd cross = one.slope * S * psi[j] * b[j].transpose();
      each.push_back(
          {m + S * k + one.alpha * b[j],
           S * T * S.transpose() + one.beta * b[j] * b[j].transpose() + cross + cross.transpose()});
      all.mean += std::exp(one.log_weight) / total * each.back().mean;
    }
    for (std::size_t j = 0; j < of.size(); ++j) {
      const Eigen::VectorXd off = each[j].mean - all.mean;
      all.covariance +=
          std::exp(of[j].log_weight) / total * (each[j].covariance + off * off.transpose());
    }
    return all;
  }
};

// Hypotheses that could be: |psi| so small beside phi, and beta so large beside slope, that each
// is a covariance.
Mixed random_mixture(Random& random, Eigen::Index f, Eigen::Index c, int n) {
  const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd x(rows, columns);
    for (double& one : x.reshaped()) one = random.uniform(-1.0, 1.0);
    return x;
  };
  Mixed mixed;
  mixed.S = normal(2 * f, c);
  for (int j = 0; j < n; ++j) {
    EventMixture::Hypothesis one;
    one.log_weight = random.uniform(-4.0, 0.0);
    Eigen::VectorXd phi = normal(c, 1);
    one.rest_phi = random.log_uniform(1e-3, 0.5);
    phi *= std::sqrt(1.0 - one.rest_phi) / phi.norm();
    Eigen::VectorXd psi = normal(c, 1);
    psi -= phi * phi.dot(psi) / phi.squaredNorm();
    psi *= random.uniform(0.3, 0.9) / psi.norm();
    one.taken_along_phi = random.uniform(0.0, 1.0);
    one.taken_along_psi = random.uniform(0.0, 0.9);
    one.shift_phi = random.uniform(-1.0, 1.0);
    one.shift_psi = random.uniform(-1.0, 1.0);
    if (random.chance(0.8)) {
      one.alpha = random.uniform(-2.0, 2.0);
      one.slope = random.uniform(-0.5, 0.5);
      one.beta = 20.0 * one.slope * one.slope;
    }
    mixed.of.push_back(one);
    mixed.phi.push_back(phi);
    mixed.psi.push_back(psi);
    mixed.b.push_back(normal(2 * f, 1));
  }
  return mixed;
}

TEST(EventMixture, CollapsesToTheMomentsOfTheWhole) {
  constexpr std::uint64_t seed = 11;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Index f = random.integer(1, 5);
    const Eigen::Index c = random.integer(static_cast<int>(2 * f), static_cast<int>(4 * f));
    const Mixed mixed = random_mixture(random, f, c, random.integer(1, EventMixture::capacity));
    EventMixture mixture(c, f);
    mixture.begin(c);
    for (std::size_t j = 0; j < mixed.of.size(); ++j) {
      mixture.add(mixed.of[j]);
      mixture.phi() = mixed.phi[j];
      mixture.psi() = mixed.psi[j];
      mixture.b_q() = mixed.b[j].head(f);
      mixture.b_u() = mixed.b[j].tail(f);
    }
    Eigen::VectorXd m(2 * f);
    for (double& one : m) one = random.uniform(-1.0, 1.0);
    const Dense expected = mixed.moments(m);
    Eigen::VectorXd q = m.head(f), u = m.tail(f);
    Eigen::MatrixXd S_q = Eigen::MatrixXd::Zero(f, c + EventMixture::added_columns());
    Eigen::MatrixXd S_u = S_q;
    S_q.leftCols(c) = mixed.S.topRows(f);
    S_u.leftCols(c) = mixed.S.bottomRows(f);
    const Eigen::Index columns = mixture.collapse(q, u, S_q, S_u);
    ASSERT_GT(columns, 0);
    Eigen::MatrixXd S(2 * f, columns);
    S << S_q.leftCols(columns), S_u.leftCols(columns);
    Eigen::VectorXd mean(2 * f);
    mean << q, u;
    EXPECT_LT((mean - expected.mean).norm(), 1e-12 * (1.0 + expected.mean.norm())) << trial;
    EXPECT_LT((S * S.transpose() - expected.covariance).norm(), 1e-11 * expected.covariance.norm())
        << trial;
  }
}

// What all hypotheses measure alike is known as well as the measurement is, not to the rounding of
// what was known before.
TEST(EventMixture, KeepsTheDigitsOfAnExactMeasurement) {
  EventMixture mixture(2, 1);
  mixture.begin(2);
  EventMixture::Hypothesis exact;
  exact.rest_phi = 1e-30;
  exact.taken_along_phi = 1.0;
  mixture.add(exact);
  mixture.phi() = Eigen::Vector2d(0.6, 0.8);
  mixture.psi() = Eigen::Vector2d::Zero();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(1), u = q;
  Eigen::MatrixXd S_q = Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns());
  Eigen::MatrixXd S_u = S_q;
  S_q(0, 0) = 0.6;  // q is what is measured
  S_q(0, 1) = 0.8;
  S_u(0, 0) = 0.8;
  S_u(0, 1) = -0.6;
  const Eigen::Index columns = mixture.collapse(q, u, S_q, S_u);
  EXPECT_NEAR(S_q.row(0).head(columns).norm() / 1e-15, 1.0, 0.3);
  EXPECT_NEAR(S_u.row(0).head(columns).norm(), 1.0, 1e-12);
}

// The time is known to 1e-8 of the machine's, and q does not depend on it: what a hypothesis says
// of xi is what its jump takes back. Of squares of the jumps themselves no digit of that is left.
TEST(EventMixture, KnowsWhatItsHypothesesAgreeIn) {
  constexpr double near = 1e-8;
  for (const double spread : {0.0, 5.0 * near}) {
    EventMixture mixture(2, 1);
    mixture.begin(2);
    double total = 0.0, variance = 0.0;
    for (int j = 0; j < 10; ++j) {
      const double x = 1.11 * (j - 4.5);
      EventMixture::Hypothesis of;
      of.log_weight = -0.5 * x * x;
      of.rest_phi = 1e-18;
      of.taken_along_phi = 1.0;
      of.alpha = 0.28 + spread * x;
      of.shift_phi = -of.alpha * x;
      of.slope = spread > 0.0 ? -0.4 * near : 0.0;
      of.beta = of.slope * of.slope;
      mixture.add(of);
      mixture.phi() = Eigen::Vector2d::UnitX();
      mixture.psi() = Eigen::Vector2d::UnitY();
      mixture.b_q()[0] = near * x;
      mixture.b_u()[0] = 1.0;
      const double w = std::exp(of.log_weight);
      total += w;
      variance += w * ((spread * x) * (spread * x) + (near + of.slope) * (near + of.slope));
    }
    Eigen::VectorXd q = Eigen::VectorXd::Zero(1), u = q;
    Eigen::MatrixXd S_q = Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns());
    Eigen::MatrixXd S_u = S_q;
    S_q(0, 0) = near;
    S_u(0, 1) = near;
    const Eigen::Index columns = mixture.collapse(q, u, S_q, S_u);
    EXPECT_LT(S_q.row(0).head(columns).norm(), 1e-15) << spread;
    EXPECT_NEAR(S_u.row(0).head(columns).norm() / std::sqrt(variance / total), 1.0, 1e-6) << spread;
  }
}

TEST(EventMixture, LeavesEverythingAsItIsWhereNothingIsPossible) {
  EventMixture mixture(2, 1);
  mixture.begin(2);
  EventMixture::Hypothesis impossible;
  impossible.log_weight = -std::numeric_limits<double>::infinity();
  mixture.add(impossible);
  impossible.log_weight = std::numeric_limits<double>::quiet_NaN();
  mixture.add(impossible);
  Eigen::VectorXd q = Eigen::VectorXd::Ones(1), u = q;
  Eigen::MatrixXd S_q = Eigen::MatrixXd::Ones(1, 2 + EventMixture::added_columns());
  Eigen::MatrixXd S_u = S_q;
  EXPECT_EQ(mixture.collapse(q, u, S_q, S_u), 0);
  EXPECT_EQ(q[0], 1.0);
  EXPECT_EQ(S_q(0, 0), 1.0);
}

}  // namespace
}  // namespace sprag
