// Against dense integration over the time of the event: every hypothesis at its own time, thousands
// of them, with full matrices.
#include "sprag/estimation/unknown_time.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>

#include "tests/support/random.h"

namespace sprag {
namespace {

struct Dense {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double weight = 0.0;
};

/// A machine of f oscillators without coupling, a support under their sum.
struct Machine {
  Eigen::VectorXd omega, delta;
  double restitution = 0.5;

  Model model() const {
    const Eigen::Index f = omega.size();
    Model model;
    model.M = Eigen::MatrixXd::Identity(f, f);
    model.C = 2.0 * Eigen::MatrixXd(delta.asDiagonal());
    model.K = Eigen::MatrixXd(omega.cwiseAbs2().asDiagonal());
    model.contacts.push_back({Eigen::VectorXd::Ones(f), 0.1, {}, restitution});
    return model;
  }
  // Of (q, u), 2 f x 2 f, forwards and backwards.
  Eigen::MatrixXd flow(double tau) const {
    const Eigen::Index f = omega.size();
    Eigen::MatrixXd Phi = Eigen::MatrixXd::Zero(2 * f, 2 * f);
    for (Eigen::Index i = 0; i < f; ++i) {
      const double damped = std::sqrt(omega[i] * omega[i] - delta[i] * delta[i]);
      const double decay = std::exp(-delta[i] * tau);
      const double c = decay * std::cos(damped * tau);
      const double s = decay * std::sin(damped * tau) / damped;
      Phi(i, i) = c + delta[i] * s;
      Phi(i, f + i) = s;
      Phi(f + i, i) = -omega[i] * omega[i] * s;
      Phi(f + i, f + i) = c - delta[i] * s;
    }
    return Phi;
  }
};

Dense integrate(const Machine& machine, const Eigen::VectorXd& m, const Eigen::MatrixXd& P,
                double sigma) {
  const Eigen::Index f = machine.omega.size();
  const double epsilon = machine.restitution;
  Eigen::VectorXd gap = Eigen::VectorXd::Zero(2 * f), velocity = gap, impact = gap;
  gap.head(f).setOnes();
  velocity.tail(f).setOnes();
  impact.tail(f).setConstant(1.0 / static_cast<double>(f));
  const auto at_age = [&](double age) {
    const Eigen::MatrixXd back = machine.flow(-age);
    const Eigen::VectorXd h = back.transpose() * gap;
    const Eigen::VectorXd v = back.transpose() * velocity;
    const double s2 = h.dot(P * h);
    const double g = 0.1 + h.dot(m);
    Dense at{m - P * h * (g / s2), P - P * h * h.transpose() * P / s2, 0.0};
    const double mu = v.dot(at.mean);
    const Eigen::VectorXd Pv = at.covariance * v;
    const double d = std::sqrt(std::max(v.dot(Pv), 1e-300));
    const FluxMoments flux = flux_moments(mu, d);
    at.mean += Pv * ((flux.mean - mu) / (d * d));
    at.covariance -= Pv * Pv.transpose() * ((1.0 - flux.variance / (d * d)) / (d * d));
    const Eigen::MatrixXd jump = Eigen::MatrixXd::Identity(2 * f, 2 * f) -
                                 (1.0 + epsilon) * machine.flow(age) * impact * v.transpose();
    at.mean = jump * at.mean;
    at.covariance = jump * at.covariance * jump.transpose();
    at.weight =
        -0.5 * std::pow(age / sigma, 2) - 0.5 * g * g / s2 - 0.5 * std::log(s2) + flux.log_weight;
    return at;
  };
  // Where the weight is, by halving around the best.
  double low = -6.0 * sigma, high = 6.0 * sigma;
  constexpr int n = 2000;
  for (int zoom = 0; zoom < 40; ++zoom) {
    std::vector<double> weights;
    for (int i = 0; i <= n / 10; ++i)
      weights.push_back(at_age(low + (high - low) * 10 * i / n).weight);
    const double best = *std::max_element(weights.begin(), weights.end());
    int first = n / 10, last = 0;
    for (int i = 0; i <= n / 10; ++i) {
      if (weights[static_cast<std::size_t>(i)] < best - 32.0) continue;
      first = std::min(first, i);
      last = std::max(last, i);
    }
    if (last - first > n / 40) break;
    const double step = (high - low) * 10 / n;
    const double next = low + step * (first - 1);
    high = low + step * (last + 1);
    low = next;
  }
  std::vector<Dense> all;
  double best = -1e300;
  for (int i = 0; i <= n; ++i) {
    all.push_back(at_age(low + (high - low) * i / n));
    best = std::max(best, all.back().weight);
  }
  Dense total{Eigen::VectorXd::Zero(2 * f), Eigen::MatrixXd::Zero(2 * f, 2 * f), 0.0};
  for (Dense& one : all) total.weight += one.weight = std::exp(one.weight - best);
  for (const Dense& one : all) total.mean += one.weight / total.weight * one.mean;
  for (const Dense& one : all) {
    const Eigen::VectorXd off = one.mean - total.mean;
    total.covariance += one.weight / total.weight * (one.covariance + off * off.transpose());
  }
  return total;
}

// From an almost exact time to sigma of a good part of a period, from hardly known states to well
// known ones: the nodes find where the weight is. (With a longer sigma a free flight can cross the
// support more than once, which a machine cannot.)
TEST(UnknownTime, IsTheIntegralOverTheTimeOfTheEvent) {
  constexpr std::uint64_t seed = 17;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double worst_mean = 0.0, worst_covariance = 0.0;
  for (int trial = 0; trial < 150; ++trial) {
    const Eigen::Index f = random.integer(1, 3);
    Machine machine{Eigen::VectorXd(f), Eigen::VectorXd(f), random.uniform(0.1, 0.9)};
    for (double& one : machine.omega) one = random.log_uniform(0.5, 20.0);
    machine.delta = 0.02 * machine.omega;
    const double sigma = random.log_uniform(1e-6, 0.25) / machine.omega.maxCoeff();
    const double spread = random.log_uniform(1e-6, 1.0);
    Eigen::MatrixXd S(2 * f, 2 * f);
    for (double& one : S.reshaped()) one = spread * random.uniform(-1.0, 1.0);
    S.bottomRows(f) *= machine.omega.mean();
    // A state that is about to hit at the reported time, give or take what is not known.
    Eigen::VectorXd m(2 * f);
    for (double& one : m) one = random.uniform(-1.0, 1.0);
    m.head(f).array() -= (0.1 + m.head(f).sum()) / static_cast<double>(f);
    m.tail(f).array() -= (m.tail(f).sum() + random.uniform(0.5, 3.0)) / static_cast<double>(f);
    const Dense expected = integrate(machine, m, S * S.transpose(), sigma);

    const Flows flows(machine.model());
    UnknownTime unknown(flows, sigma, 2 * f + EventMixture::added_columns());
    Belief belief{m.head(f), m.tail(f),
                  Eigen::MatrixXd::Zero(f, 2 * f + EventMixture::added_columns()),
                  Eigen::MatrixXd::Zero(f, 2 * f + EventMixture::added_columns()), 2 * f};
    belief.S_q.leftCols(2 * f) = S.topRows(f);
    belief.S_u.leftCols(2 * f) = S.bottomRows(f);
    Motion motion;
    flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
    UnknownTime::Innovation innovation;
    ASSERT_TRUE(unknown.take({UncertainEvent::Kind::pulse, 0, 0}, motion, {1e-3, 1e-3}, 0.0, false,
                             belief, innovation));
    Eigen::VectorXd mean(2 * f);
    mean << belief.q, belief.u;
    Eigen::MatrixXd root(2 * f, belief.columns);
    root << belief.S_q.leftCols(belief.columns), belief.S_u.leftCols(belief.columns);
    // Against the deviations themselves, axis by axis.
    const Eigen::VectorXd deviation = expected.covariance.diagonal().cwiseSqrt();
    const double off_mean = (mean - expected.mean).cwiseQuotient(deviation).cwiseAbs().maxCoeff();
    const Eigen::MatrixXd off = (root * root.transpose() - expected.covariance)
                                    .cwiseQuotient(deviation * deviation.transpose());
    worst_mean = std::max(worst_mean, off_mean);
    worst_covariance = std::max(worst_covariance, off.cwiseAbs().maxCoeff());
    EXPECT_LT(off_mean, 0.05) << "trial " << trial << ", omega sigma "
                              << sigma * machine.omega.maxCoeff() << ", spread " << spread;
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.05)
        << "trial " << trial << ", omega sigma " << sigma * machine.omega.maxCoeff() << ", spread "
        << spread;
  }
  std::cout << "largest differences, in deviations and variances: " << worst_mean << ", "
            << worst_covariance << '\n';
}

// An open contact that is far above its support has not closed; one far below must have.
TEST(UnknownTime, SilenceIsAsLikelyAsTheGapIsOpen) {
  const Machine machine{Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, 0.01), 0.5};
  const Flows flows(machine.model());
  const double sigma = 1e-3;
  UnknownTime unknown(flows, sigma, 2 + EventMixture::added_columns());
  const auto log_probability = [&](double gap) {
    Belief belief{Eigen::VectorXd::Constant(1, gap - 0.1), Eigen::VectorXd::Constant(1, -1.0),
                  Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns()),
                  Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns()), 2};
    belief.S_q(0, 0) = belief.S_u(0, 1) = 1e-6;
    Motion motion;
    flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
    return unknown.hear_nothing({UncertainEvent::Kind::pulse, 0, 0}, motion, {1.0, 1.0}, false,
                                belief);
  };
  EXPECT_NEAR(log_probability(1e-2), 0.0, 1e-6);
  // It was at contact 1 sigma ago: a report that is as late as that or later.
  EXPECT_NEAR(std::exp(log_probability(-1e-3)), 0.1587, 0.003);
  EXPECT_NEAR(std::exp(log_probability(-2e-3)), 0.0228, 0.001);
  EXPECT_LT(log_probability(-2e-2), -24.5);
}

// The n-th of a row takes what is left for it to take, not the share of restitution once more.
TEST(UnknownTime, BurstsTakeTheEnergyOfAChatter) {
  const Machine machine{Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, 0.01), 0.5};
  const Flows flows(machine.model());
  UnknownTime unknown(flows, 1e-3, 2 + EventMixture::added_columns());
  for (const int n : {1, 2, 30}) {
    for (const double gamma : {0.0, -0.7, 2.0}) {
      Belief belief{Eigen::VectorXd::Constant(1, -0.1), Eigen::VectorXd::Constant(1, gamma),
                    Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns()),
                    Eigen::MatrixXd::Zero(1, 2 + EventMixture::added_columns()), 2};
      belief.S_u(0, 1) = 1.0;
      Motion motion;
      flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
      UncertainEvent burst;
      burst.kind = UncertainEvent::Kind::burst;
      burst.in_row = n;
      UnknownTime::Innovation innovation;
      ASSERT_TRUE(unknown.take(burst, motion, {1.0, 1.0}, 0.0, false, belief, innovation));
      EXPECT_FALSE(innovation.measured);
      const double energy =
          belief.u.squaredNorm() + belief.S_u.leftCols(belief.columns).squaredNorm();
      const double taken = 0.75 * std::pow(0.25, n);
      EXPECT_NEAR(energy / (gamma * gamma + 1.0), 1.0 - taken, 0.01) << n << ' ' << gamma;
    }
  }
}

}  // namespace
}  // namespace sprag
