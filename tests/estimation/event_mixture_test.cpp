#include "sprag/estimation/event_mixture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/estimation/beliefs.h"
#include "tests/support/random.h"

namespace sprag {
namespace {

// Of y = -gamma > 0 with the density (y + even) N(y; a, 1), by Simpson's rule in long double.
FluxMoments by_quadrature(double a, double even) {
  using Real = long double;
  const Real peak = (a + std::sqrt(Real(a) * a + 4)) / 2;
  const auto log_density = [&](Real y) { return std::log(y + even) - (y - a) * (y - a) / 2; };
  const Real low = std::max<Real>(0, peak - 14);
  const Real high = peak + 14;
  constexpr int n = 200000;
  Real sums[3] = {0, 0, 0};
  for (int i = 0; i <= n; ++i) {
    const Real y = low + (high - low) * i / n;
    const Real weight = (i % n == 0   ? 1
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
    for (const double even : {0.0, 0.3, 1e6}) {
      const FluxMoments expected = by_quadrature(a, even);
      for (const double d : {1e-9, 1.0, 1e6}) {
        const FluxMoments moments = flux_moments(-a * d, d, even * d);
        const double tolerance = a < -8.0 ? 1e-3 : 1e-8;
        EXPECT_NEAR(moments.log_weight - std::log(d), expected.log_weight, tolerance) << a;
        EXPECT_NEAR(moments.mean / d / expected.mean, 1.0, tolerance) << a;
        EXPECT_NEAR(moments.variance / (d * d) / expected.variance, 1.0, 10.0 * tolerance) << a;
      }
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

// The moments of the mixture with full matrices, one hypothesis and component after the other.
struct Mixed {
  Eigen::MatrixXd S;  // 2 f x c
  std::vector<double> weights{1.0};
  std::vector<Eigen::VectorXd> offs;  // of the components' means
  // What each hypothesis says of each component.
  std::vector<std::vector<EventMixture::Hypothesis>> of;
  std::vector<Eigen::VectorXd> phi, psi, b;

  Dense moments(const Eigen::VectorXd& m) const {
    double total = 0.0;
    for (const auto& hypothesis : of) {
      for (const auto& one : hypothesis) total += std::exp(one.log_weight);
    }
    Dense all{Eigen::VectorXd::Zero(m.size()), Eigen::MatrixXd::Zero(m.size(), m.size())};
    std::vector<Dense> each;
    std::vector<double> share;
    for (std::size_t j = 0; j < of.size(); ++j) {
      for (std::size_t i = 0; i < of[j].size(); ++i) {
        const auto& one = of[j][i];
        const Eigen::VectorXd k = one.shift_phi * phi[j] + one.shift_psi * psi[j];
        const Eigen::MatrixXd T = Eigen::MatrixXd::Identity(k.size(), k.size()) -
                                  one.taken_along_phi * phi[j] * phi[j].transpose() -
                                  one.taken_along_psi * psi[j] * psi[j].transpose();
        const Eigen::MatrixXd cross = one.slope * S * psi[j] * b[j].transpose();
        each.push_back({m + S * k + one.alpha * b[j], S * T * S.transpose() +
                                                          one.beta * b[j] * b[j].transpose() +
                                                          cross + cross.transpose()});
        if (!offs.empty()) each.back().mean += offs[i];
        share.push_back(std::exp(one.log_weight) / total);
        all.mean += share.back() * each.back().mean;
      }
    }
    for (std::size_t k = 0; k < each.size(); ++k) {
      const Eigen::VectorXd off = each[k].mean - all.mean;
      all.covariance += share[k] * (each[k].covariance + off * off.transpose());
    }
    return all;
  }

  // The mean given hypothesis j, and its share of the weight.
  std::pair<Eigen::VectorXd, double> of_hypothesis(std::size_t j, const Eigen::VectorXd& m) const {
    Mixed alone = *this;
    alone.of = {of[j]};
    alone.phi = {phi[j]};
    alone.psi = {psi[j]};
    alone.b = {b[j]};
    double total = 0.0, mine = 0.0;
    for (std::size_t k = 0; k < of.size(); ++k) {
      for (const auto& one : of[k]) {
        total += std::exp(one.log_weight);
        if (k == j) mine += std::exp(one.log_weight);
      }
    }
    return {alone.moments(m).mean, mine / total};
  }

  Belief belief(const Eigen::VectorXd& m) const {
    Eigen::MatrixXd all(S.rows(), S.cols() + static_cast<Eigen::Index>(offs.size()));
    for (std::size_t i = 0; i < offs.size(); ++i) {
      all.col(static_cast<Eigen::Index>(i)) = std::sqrt(weights[i]) * offs[i];
    }
    all.rightCols(S.cols()) = S;
    Belief belief = belief_of(m, all);
    belief.components = static_cast<int>(offs.size());
    for (std::size_t i = 0; i < offs.size(); ++i) belief.weights[i] = weights[i];
    return belief;
  }

  void add_to(EventMixture& mixture) const {
    const Eigen::Index f = S.rows() / 2;
    for (std::size_t j = 0; j < of.size(); ++j) {
      mixture.add(of[j]);
      mixture.phi() = phi[j];
      mixture.psi() = psi[j];
      mixture.b_q() = b[j].head(f);
      mixture.b_u() = b[j].tail(f);
    }
  }
};

// Hypotheses that could be: |psi| so small beside phi, and beta so large beside slope, that each
// is a covariance.
Mixed random_mixture(Random& random, Eigen::Index f, Eigen::Index c, int n, int components) {
  const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd x(rows, columns);
    for (double& one : x.reshaped()) one = random.uniform(-1.0, 1.0);
    return x;
  };
  Mixed mixed;
  mixed.S = normal(2 * f, c);
  if (components > 0) mixed.weights.assign(static_cast<std::size_t>(components), 1.0 / components);
  for (int i = 0; i < components; ++i) mixed.offs.push_back(3.0 * normal(2 * f, 1));
  for (int j = 0; j < n; ++j) {
    Eigen::VectorXd phi = normal(c, 1);
    const double rest_phi = random.log_uniform(1e-3, 0.5);
    phi *= std::sqrt(1.0 - rest_phi) / phi.norm();
    Eigen::VectorXd psi = normal(c, 1);
    psi -= phi * phi.dot(psi) / phi.squaredNorm();
    psi *= random.uniform(0.3, 0.9) / psi.norm();
    const double taken_along_phi = random.uniform(0.0, 1.0);
    const bool jumps = random.chance(0.8);
    std::vector<EventMixture::Hypothesis> of_components;
    for (int i = 0; i < std::max(components, 1); ++i) {
      EventMixture::Hypothesis one;
      one.log_weight = random.uniform(-4.0, 0.0);
      one.rest_phi = rest_phi;
      one.taken_along_phi = taken_along_phi;
      one.taken_along_psi = random.uniform(0.0, 0.9);
      one.shift_phi = random.uniform(-1.0, 1.0);
      one.shift_psi = random.uniform(-1.0, 1.0);
      if (jumps) {
        one.alpha = random.uniform(-2.0, 2.0);
        one.slope = random.uniform(-0.5, 0.5);
        one.beta = 20.0 * one.slope * one.slope;
      }
      of_components.push_back(one);
    }
    mixed.of.push_back(of_components);
    mixed.phi.push_back(phi);
    mixed.psi.push_back(psi);
    mixed.b.push_back(normal(2 * f, 1));
  }
  return mixed;
}

// From one Gaussian or several, to one or several: the moments of the whole are the same.
TEST(EventMixture, CollapsesToTheMomentsOfTheWhole) {
  constexpr std::uint64_t seed = 11;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  for (int trial = 0; trial < 400; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Eigen::Index f = random.integer(1, 5);
    const Eigen::Index c = random.integer(static_cast<int>(2 * f), static_cast<int>(4 * f));
    const int components = trial % 2 == 0 ? 0 : random.integer(2, Belief::most_components);
    const Mixed mixed =
        random_mixture(random, f, c, random.integer(1, EventMixture::capacity), components);
    Eigen::VectorXd m(2 * f);
    for (double& one : m) one = random.uniform(-1.0, 1.0);
    const Dense expected = mixed.moments(m);
    EventMixture mixture(c, f);
    for (const int keep : {0, 3, Belief::most_components}) {
      Belief belief = mixed.belief(m);
      mixture.begin(belief);
      mixed.add_to(mixture);
      ASSERT_TRUE(mixture.collapse(keep, belief));
      EXPECT_LE(belief.components, keep);
      EXPECT_LT((mean_of(belief) - expected.mean).norm(), 1e-12 * (1.0 + expected.mean.norm()));
      EXPECT_LT((covariance_of(belief) - expected.covariance).norm(),
                (components > 0 ? 1e-7 : 1e-11) * expected.covariance.norm());
    }
  }
}

// Components are the likeliest hypotheses: their weights, and where their means are, but that all
// move towards the mean of the whole by as much as each is made wider.
TEST(EventMixture, ComponentsAreTheLikeliestHypotheses) {
  constexpr std::uint64_t seed = 12;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const int components = trial % 2 == 0 ? 0 : Belief::most_components;
    const Mixed mixed = random_mixture(random, 2, 6, random.integer(4, 20), components);
    const Eigen::VectorXd m = Eigen::VectorXd::Zero(4);
    const Dense all = mixed.moments(m);
    std::vector<std::pair<double, Eigen::VectorXd>> likeliest;
    for (std::size_t j = 0; j < mixed.of.size(); ++j) {
      const auto [mean, weight] = mixed.of_hypothesis(j, m);
      likeliest.emplace_back(weight, mean);
    }
    std::sort(likeliest.begin(), likeliest.end(),
              [](const auto& a, const auto& b) { return a.first > b.first; });
    Belief belief = mixed.belief(m);
    EventMixture mixture(6, 2);
    mixture.begin(belief);
    mixed.add_to(mixture);
    ASSERT_TRUE(mixture.collapse(4, belief));
    ASSERT_EQ(belief.components, 4);
    double narrower = 0.0;
    for (int k = 0; k < belief.components; ++k) {
      const double weight = belief.weights[static_cast<std::size_t>(k)];
      const auto same =
          std::find_if(likeliest.begin(), likeliest.begin() + belief.components,
                       [&](const auto& one) { return std::abs(one.first / weight - 1.0) < 1e-12; });
      ASSERT_NE(same, likeliest.begin() + belief.components);
      const Eigen::VectorXd off = columns_of(belief, k, 1) / std::sqrt(weight);
      const Eigen::VectorXd apart = same->second - all.mean;
      if (k == 0) narrower = off.norm() / apart.norm();
      EXPECT_LT((off - narrower * apart).norm(), 1e-10);
    }
    EXPECT_GT(narrower, 0.8);
    EXPECT_LT(narrower, 1.0);
  }
}

// What all hypotheses measure alike is known as well as the measurement is, not to the rounding of
// what was known before.
TEST(EventMixture, KeepsTheDigitsOfAnExactMeasurement) {
  EventMixture mixture(2, 1);
  Belief belief = belief_of(Eigen::Vector2d::Zero(),
                            Eigen::Matrix2d{{0.6, 0.8}, {0.8, -0.6}});  // q is what is measured
  mixture.begin(belief);
  EventMixture::Hypothesis exact;
  exact.rest_phi = 1e-30;
  exact.taken_along_phi = 1.0;
  mixture.add(exact);
  mixture.phi() = Eigen::Vector2d(0.6, 0.8);
  mixture.psi() = Eigen::Vector2d::Zero();
  ASSERT_TRUE(mixture.collapse(0, belief));
  EXPECT_NEAR(belief.S_q.row(0).head(belief.columns).norm() / 1e-15, 1.0, 0.3);
  EXPECT_NEAR(belief.S_u.row(0).head(belief.columns).norm(), 1.0, 1e-12);
}

// The time is known to 1e-8 of the machine's, and q does not depend on it: what a hypothesis says
// of xi is what its jump takes back. Of squares of the jumps themselves no digit of that is left.
TEST(EventMixture, KnowsWhatItsHypothesesAgreeIn) {
  constexpr double near = 1e-8;
  for (const double spread : {0.0, 5.0 * near}) {
    EventMixture mixture(2, 1);
    Belief belief = belief_of(Eigen::Vector2d::Zero(), near * Eigen::Matrix2d::Identity());
    mixture.begin(belief);
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
    ASSERT_TRUE(mixture.collapse(0, belief));
    EXPECT_LT(belief.S_q.row(0).head(belief.columns).norm(), 1e-15) << spread;
    EXPECT_NEAR(belief.S_u.row(0).head(belief.columns).norm() / std::sqrt(variance / total), 1.0,
                1e-6)
        << spread;
  }
}

TEST(EventMixture, LeavesEverythingAsItIsWhereNothingIsPossible) {
  EventMixture mixture(2, 1);
  Belief belief = belief_of(Eigen::Vector2d::Ones(), Eigen::Matrix2d::Ones());
  mixture.begin(belief);
  EventMixture::Hypothesis impossible;
  impossible.log_weight = -std::numeric_limits<double>::infinity();
  mixture.add(impossible);
  impossible.log_weight = std::numeric_limits<double>::quiet_NaN();
  mixture.add(impossible);
  EXPECT_FALSE(mixture.collapse(Belief::most_components, belief));
  EXPECT_EQ(belief.columns, 2);
  EXPECT_EQ(belief.components, 0);
  EXPECT_EQ(belief.q[0], 1.0);
  EXPECT_EQ(belief.S_q(0, 0), 1.0);
}

}  // namespace
}  // namespace sprag
