// Against dense integration over the time of the event: every hypothesis at its own time, thousands
// of them, with full matrices.
#include "sprag/estimation/unknown_time.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "sprag/estimation/belief.h"
#include "tests/estimation/beliefs.h"
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

// How much the sign alone counts at a report of a gap of zero now: s^2 / (|gamma| sigma^2).
double even_of(const Machine& machine, const Dense& of, double sigma) {
  const Eigen::Index f = machine.omega.size();
  const Eigen::MatrixXd& P = of.covariance;
  const double s2 = P.topLeftCorner(f, f).sum();
  const double both = P.topRightCorner(f, f).sum();
  const double d = std::sqrt(std::max(P.bottomRightCorner(f, f).sum() - both * both / s2, 0.0));
  const double gap = 0.1 + of.mean.head(f).sum();
  const double mu = of.mean.tail(f).sum() - both / s2 * gap;
  return s2 / (-flux_moments(mu, d, 0.0).mean * sigma * sigma);
}

// What an impact at this age, reported at none, makes of a Gaussian; `weight` is its logarithm,
// on top of the Gaussian's own.
Dense at_age(const Machine& machine, const Dense& of, double age, double sigma, double even) {
  const Eigen::Index f = machine.omega.size();
  const double epsilon = machine.restitution;
  Eigen::VectorXd gap = Eigen::VectorXd::Zero(2 * f), velocity = gap, impact = gap;
  gap.head(f).setOnes();
  velocity.tail(f).setOnes();
  impact.tail(f).setConstant(1.0 / static_cast<double>(f));
  const Eigen::MatrixXd& P = of.covariance;
  const Eigen::MatrixXd back = machine.flow(-age);
  const Eigen::VectorXd h = back.transpose() * gap;
  const Eigen::VectorXd v = back.transpose() * velocity;
  const double s2 = h.dot(P * h);
  const double g = 0.1 + h.dot(of.mean);
  Dense at{of.mean - P * h * (g / s2), P - P * h * h.transpose() * P / s2, 0.0};
  const double mu = v.dot(at.mean);
  const Eigen::VectorXd Pv = at.covariance * v;
  const double d = std::sqrt(std::max(v.dot(Pv), 1e-300));
  const FluxMoments flux = flux_moments(mu, d, even);
  at.mean += Pv * ((flux.mean - mu) / (d * d));
  at.covariance -= Pv * Pv.transpose() * ((1.0 - flux.variance / (d * d)) / (d * d));
  const Eigen::MatrixXd jump = Eigen::MatrixXd::Identity(2 * f, 2 * f) -
                               (1.0 + epsilon) * machine.flow(age) * impact * v.transpose();
  at.mean = jump * at.mean;
  at.covariance = jump * at.covariance * jump.transpose();
  at.weight = of.weight - 0.5 * std::pow(age / sigma, 2) - 0.5 * g * g / s2 - 0.5 * std::log(s2) +
              flux.log_weight;
  return at;
}

// The Gaussian with the moments of all.
Dense whole(std::vector<Dense> all) {
  double best = -1e300;
  for (const Dense& one : all) best = std::max(best, one.weight);
  const Eigen::Index n = all.front().mean.size();
  Dense total{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n), 0.0};
  for (Dense& one : all) total.weight += one.weight = std::exp(one.weight - best);
  for (const Dense& one : all) total.mean += one.weight / total.weight * one.mean;
  for (const Dense& one : all) {
    const Eigen::VectorXd off = one.mean - total.mean;
    total.covariance += one.weight / total.weight * (one.covariance + off * off.transpose());
  }
  return total;
}

Dense integrate(const Machine& machine, const Eigen::VectorXd& m, const Eigen::MatrixXd& P,
                double sigma) {
  const Dense of{m, P, 0.0};
  const double even = even_of(machine, of, sigma);
  // Where the weight is, by halving around the best.
  double low = -6.0 * sigma, high = 6.0 * sigma;
  constexpr int n = 2000;
  for (int zoom = 0; zoom < 40; ++zoom) {
    std::vector<double> weights;
    for (int i = 0; i <= n / 10; ++i)
      weights.push_back(at_age(machine, of, low + (high - low) * 10 * i / n, sigma, even).weight);
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
  for (int i = 0; i <= n; ++i) {
    all.push_back(at_age(machine, of, low + (high - low) * i / n, sigma, even));
  }
  return whole(std::move(all));
}

Dense moments_of(const Belief& belief) { return {mean_of(belief), covariance_of(belief), 1.0}; }

// In deviations and variances themselves, axis by axis.
struct Off {
  double mean, covariance;
};
Off off(const Dense& actual, const Dense& expected) {
  const Eigen::VectorXd deviation = expected.covariance.diagonal().cwiseSqrt();
  return {(actual.mean - expected.mean).cwiseQuotient(deviation).cwiseAbs().maxCoeff(),
          (actual.covariance - expected.covariance)
              .cwiseQuotient(deviation * deviation.transpose())
              .cwiseAbs()
              .maxCoeff()};
}

std::string name_of(int trial, const Machine& machine, double sigma, double spread) {
  return "trial " + std::to_string(trial) + ", omega sigma " +
         std::to_string(sigma * machine.omega.maxCoeff()) + ", spread " + std::to_string(spread);
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
    UnknownTime unknown(flows, sigma, 2 * f);
    Belief belief = belief_of(m, S);
    Motion motion;
    flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
    UnknownTime::Innovation innovation;
    ASSERT_TRUE(unknown.take({UncertainEvent::Kind::pulse, 0, 0}, motion, {1e-3, 1e-3}, 0.0, false,
                             belief, innovation));
    const auto [of_mean, of_covariance] = off(moments_of(belief), expected);
    worst_mean = std::max(worst_mean, of_mean);
    worst_covariance = std::max(worst_covariance, of_covariance);
    const std::string where = name_of(trial, machine, sigma, spread);
    EXPECT_LT(of_mean, 0.05) << where;
    EXPECT_LT(of_covariance, 0.05) << where;
  }
  std::cout << "largest differences, in deviations and variances: " << worst_mean << ", "
            << worst_covariance << '\n';
}

// A contact of this machine is held, and its force is nothing at about t; S keeps its gap and its
// gap velocity.
struct Held {
  Eigen::VectorXd m;
  Eigen::MatrixXd S;
};
Held about_to_leave(const Machine& machine, double spread, Random& random) {
  const Eigen::Index f = machine.omega.size();
  Held held{Eigen::VectorXd(2 * f), Eigen::MatrixXd(2 * f, 2 * f - 2)};
  for (double& one : held.m) one = random.uniform(-1.0, 1.0);
  for (double& one : held.S.reshaped()) one = spread * random.uniform(-1.0, 1.0);
  held.S.bottomRows(f) *= machine.omega.mean();
  held.m.tail(f) *= machine.omega.mean();
  held.m.head(f).array() -= (0.1 + held.m.head(f).sum()) / static_cast<double>(f);
  held.m.tail(f).array() -= held.m.tail(f).mean();
  for (Eigen::Index k = 0; k < held.S.cols(); ++k) {
    held.S.col(k).head(f).array() -= held.S.col(k).head(f).mean();
    held.S.col(k).tail(f).array() -= held.S.col(k).tail(f).mean();
  }
  const Eigen::VectorXd k = machine.omega.cwiseAbs2();
  if (k.dot(held.m.tail(f)) > 0.0) held.m.tail(f) *= -1.0;
  // The springs alone push it on; what the dashpots do is small.
  const double too_much = k.dot(held.m.head(f)) / (k[0] - k[1]);
  held.m[0] -= too_much;
  held.m[1] += too_much;
  return held;
}

// What the release of the held contact, reported at t, makes of its belief: every time of it with
// the flows before and behind it.
Dense integrate_release(const Flows& flows, const Held& held, Instant t, double sigma) {
  const Flow& closed = *flows.find(1);
  const Flow& free = *flows.find(0);
  const Eigen::Index f = held.m.size() / 2;
  const Eigen::Index c = held.S.cols();
  const Eigen::VectorXd no_gap = Eigen::VectorXd::Zero(1);
  const auto go = [&](const Flow& flow, const Eigen::VectorXd& x, Instant from, double tau,
                      Motion& motion) {
    flow.enter(x.head(f), x.tail(f), from, no_gap.head(flow.locked() == 0 ? 0 : 1), motion);
    flow.propagate(motion, from + tau, motion);
    Eigen::VectorXd q(f), u(f), moved(2 * f);
    flow.state(motion, q, u);
    moved << q, u;
    return moved;
  };
  const Signal& lambda = closed.force(0);
  std::vector<Dense> all;
  double even = 0.0;
  constexpr int n = 1200;
  // The first one is the report's own time, which says what the sign alone counts.
  for (int i = -1; i <= n; ++i) {
    const double age = i < 0 ? 0.0 : 6.0 * sigma * (2.0 * i / n - 1.0);
    Motion motion;
    const Eigen::VectorXd m = go(closed, held.m, t, -age, motion);
    const double l = value(lambda, motion), l_rate = rate(lambda, motion);
    const Eigen::VectorXd m_now = go(free, m, t + -age, age, motion);
    Eigen::VectorXd phi(c), psi(c);
    Eigen::MatrixXd S_now(2 * f, c);
    for (Eigen::Index k = 0; k < c; ++k) {
      const Eigen::VectorXd x = go(closed, held.m + held.S.col(k), t, -age, motion);
      phi[k] = value(lambda, motion) - l;
      psi[k] = rate(lambda, motion) - l_rate;
      S_now.col(k) = go(free, x, t + -age, age, motion) - m_now;
    }
    const double s2 = phi.squaredNorm();
    const double kappa = phi.dot(psi) / s2;
    psi -= kappa * phi;
    const double mu = l_rate - kappa * l;
    const double d = psi.norm();
    if (i < 0) {
      even = s2 / (-flux_moments(mu, d, 0.0).mean * sigma * sigma);
      continue;
    }
    const FluxMoments flux = flux_moments(mu, d, even);
    const Eigen::VectorXd xi = -l / s2 * phi + (flux.mean - mu) / (d * d) * psi;
    const Eigen::MatrixXd T = Eigen::MatrixXd::Identity(c, c) - phi * phi.transpose() / s2 -
                              psi * psi.transpose() * ((1.0 - flux.variance / (d * d)) / (d * d));
    all.push_back({m_now + S_now * xi, S_now * T * S_now.transpose(),
                   -0.5 * std::pow(age / sigma, 2) - 0.5 * l * l / s2 - 0.5 * std::log(s2) +
                       flux.log_weight});
  }
  return whole(std::move(all));
}

// What is known behind a release is what is known on the free flight since: the gap, which was zero
// before, as well.
TEST(UnknownTime, AReleaseIsNearTheIntegralOverItsTime) {
  constexpr std::uint64_t seed = 31;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double worst_mean = 0.0, widest = 0.0, narrowest = 1e300;
  for (int trial = 0; trial < 60; ++trial) {
    const Eigen::Index f = random.integer(2, 3);
    Machine machine{Eigen::VectorXd(f), Eigen::VectorXd(f), 0.5};
    for (double& one : machine.omega) one = random.log_uniform(0.5, 20.0);
    machine.delta = 0.02 * machine.omega;
    const double sigma = random.log_uniform(0.03, 0.3) / machine.omega.maxCoeff();
    const double spread = random.log_uniform(1e-2, 1.0);
    const Held held = about_to_leave(machine, spread, random);
    const Flows flows(machine.model());
    const Dense expected = integrate_release(flows, held, at(1.0), sigma);

    UnknownTime unknown(flows, sigma, 8 * f);
    Belief belief = belief_of(held.m, held.S);
    Motion motion;
    flows.find(1)->enter(belief.q, belief.u, at(1.0), Eigen::VectorXd::Zero(1), motion);
    UnknownTime::Innovation innovation;
    ASSERT_TRUE(unknown.take({UncertainEvent::Kind::releases, 0, 0}, motion, {1e-3, 1e-3}, 0.0,
                             false, belief, innovation));
    const Dense actual = moments_of(belief);
    const double of_mean = off(actual, expected).mean;
    const Eigen::VectorXd one = Eigen::VectorXd::Ones(f);
    const auto gap = [&](const Dense& of) {
      return std::sqrt(one.dot(of.covariance.topLeftCorner(f, f) * one));
    };
    const double ratio = gap(actual) / gap(expected);
    worst_mean = std::max(worst_mean, of_mean);
    widest = std::max(widest, ratio);
    narrowest = std::min(narrowest, ratio);
    const std::string where = name_of(trial, machine, sigma, spread);
    EXPECT_LT(of_mean, 0.01) << where;
    EXPECT_NEAR(ratio, 1.0, 0.1) << where;
  }
  std::cout << "largest difference of means, in deviations: " << worst_mean
            << "; deviation of the gap " << narrowest << " to " << widest << " times as large\n";
}

// Two impacts in a row, against every pair of their times. Between them the likeliest times of the
// first are kept apart: what is known there is curved, and of one Gaussian the second would make
// something else.
TEST(UnknownTime, TwoImpactsAreNearTheIntegralOverBothTimes) {
  constexpr std::uint64_t seed = 23;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  int trials = 0;
  double mean_of_one = 0.0, mean_of_several = 0.0, covariance_of_one = 0.0,
         covariance_of_several = 0.0;
  for (int trial = 0; trial < 40; ++trial) {
    const Eigen::Index f = 2;
    Machine machine{Eigen::Vector2d(1.0, random.uniform(8.0, 14.0)), Eigen::Vector2d(0.02, 0.05),
                    random.uniform(0.5, 0.9)};
    const double sigma = random.uniform(0.01, 0.03);
    // Little is not known but when it meets the support.
    Eigen::VectorXd m(2 * f);
    m << -0.1, 0.0, -random.uniform(0.5, 1.5), random.uniform(-0.2, 0.2);
    Eigen::MatrixXd S = 0.003 * Eigen::MatrixXd::Identity(2 * f, 2 * f);
    S(0, 0) = random.uniform(0.01, 0.03);
    const Dense prior{m, S * S.transpose(), 0.0};

    // The mean's way to its second impact.
    const double even = even_of(machine, prior, sigma);
    const Dense first = at_age(machine, prior, 0.0, sigma, even);
    const auto gap_after = [&](double tau) {
      return 0.1 + (machine.flow(tau) * first.mean).head(f).sum();
    };
    double flight = 8.0 * sigma;
    if (gap_after(flight) < 0.0) continue;  // it has met the support again by then
    while (gap_after(flight) > 0.0) flight += 0.01;
    const Eigen::MatrixXd on = machine.flow(flight);
    const double even_then =
        even_of(machine, {on * first.mean, on * first.covariance * on.transpose(), 0.0}, sigma);
    std::vector<Dense> both;
    constexpr int n = 160;
    const auto age = [&](int i) { return sigma * (10.0 * i / n - 5.0); };
    for (int i = 0; i <= n; ++i) {
      Dense one = at_age(machine, prior, age(i), sigma, even);
      one.mean = on * one.mean;
      one.covariance = on * one.covariance * on.transpose();
      for (int j = 0; j <= n; ++j) both.push_back(at_age(machine, one, age(j), sigma, even_then));
    }
    const Dense expected = whole(std::move(both));

    const Flows flows(machine.model());
    UnknownTime unknown(flows, sigma, 4 * f + Belief::most_components);
    BeliefColumns columns(flows[0], f,
                          8 * f + Belief::most_components + EventMixture::added_columns(8 * f));
    const auto after_both = [&](bool several) {
      Belief belief = belief_of(m, S);
      Motion motion;
      flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
      const UncertainEvent pulse{UncertainEvent::Kind::pulse, 0, 0};
      UnknownTime::Innovation innovation;
      EXPECT_TRUE(unknown.take(pulse, motion, {1e-3, 1e-3}, 0.0, false, belief, innovation));
      EXPECT_GT(belief.components, 1);
      if (!several) belief.components = 0;
      columns.merge(belief);
      flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
      flows[0].propagate(motion, at(1.0 + flight), motion);
      flows[0].state(motion, belief.q, belief.u);
      columns.move(flows[0], flight, belief);
      EXPECT_TRUE(unknown.take(pulse, motion, {1e-3, 1e-3}, 0.0, false, belief, innovation));
      return off(moments_of(belief), expected);
    };
    const Off one = after_both(false);
    const Off several = after_both(true);
    ++trials;
    mean_of_one += one.mean;
    mean_of_several += several.mean;
    covariance_of_one += one.covariance;
    covariance_of_several += several.covariance;
  }
  EXPECT_GT(trials, 20);
  std::cout << trials << " pairs, sums of differences of means, in deviations, as one Gaussian "
            << mean_of_one << ", as several " << mean_of_several << "; of variances "
            << covariance_of_one << ", " << covariance_of_several << '\n';
  EXPECT_LT(mean_of_several, 0.7 * mean_of_one);
  EXPECT_LT(covariance_of_several, 0.65 * covariance_of_one);
}

// A machine that is as it is, not drawn from what is believed of it: estimates about it, all of the
// same covariance, are told one of its impacts. Be the time known better than the state or worse,
// and the impact slow against what is not known of its speed, what is believed afterwards is no
// further off than it says. The flux as weight of velocities would take this machine for a faster
// one.
TEST(UnknownTime, AnImpactIsWorthWhatItTellsOfAnyState) {
  constexpr std::uint64_t seed = 29;
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  const Machine machine{Eigen::Vector3d(1.0, 3.0, 7.0), Eigen::Vector3d(0.01, 0.02, 0.03), 0.6};
  const Flows flows(machine.model());
  constexpr Eigen::Index f = 3;
  Eigen::VectorXd gap = Eigen::VectorXd::Zero(2 * f), velocity = gap, impact = gap;
  gap.head(f).setOnes();
  velocity.tail(f).setOnes();
  impact.tail(f).setConstant(1.0 / static_cast<double>(f));
  Eigen::VectorXd x(2 * f);  // at the impact, before it
  x << -0.3, 0.5, -0.3, 0.1, -0.6, 0.1;
  const double gamma = velocity.dot(x);
  ASSERT_NEAR(gap.dot(x), -0.1, 1e-12);
  const Eigen::MatrixXd jump = Eigen::MatrixXd::Identity(2 * f, 2 * f) -
                               (1.0 + machine.restitution) * impact * velocity.transpose();
  for (const double known : {0.03, 1.0, 10.0}) {  // time against state
    const double of_q = 0.01 / std::max(known, 1.0);
    Eigen::VectorXd deviations(2 * f);
    deviations << of_q, of_q, of_q, 0.15, 0.15, 0.15;
    const double sigma = known * std::sqrt(1.0 * f) * of_q / std::abs(gamma);
    UnknownTime unknown(flows, sigma, 2 * f);
    constexpr int draws = 4000;
    double squares = 0.0;
    for (int draw = 0; draw < draws; ++draw) {
      const double late = sigma * normal(engine);
      const Eigen::VectorXd off =
          Eigen::VectorXd::NullaryExpr(2 * f, [&] { return normal(engine); });
      Belief belief = belief_of(machine.flow(late) * (x + deviations.cwiseProduct(off)),
                                machine.flow(late) * deviations.asDiagonal().toDenseMatrix());
      Motion motion;
      flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
      UnknownTime::Innovation innovation;
      ASSERT_TRUE(unknown.take({UncertainEvent::Kind::pulse, 0, 0}, motion, {1e-3, 1e-3}, 0.0,
                               false, belief, innovation));
      const Eigen::VectorXd error = mean_of(belief) - machine.flow(late) * jump * x;
      squares += error.cwiseAbs2().cwiseQuotient(covariance_of(belief).diagonal()).mean();
    }
    std::cout << "seed " << seed << ", jitter over the gap's deviation " << known
              << ": mean square " << squares / draws << '\n';
    EXPECT_LT(squares / draws, 1.05) << known;
    EXPECT_GT(squares / draws, 0.85) << known;
  }
}

// An open contact that is far above its support has not closed; one far below must have.
TEST(UnknownTime, SilenceIsAsLikelyAsTheGapIsOpen) {
  const Machine machine{Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, 0.01), 0.5};
  const Flows flows(machine.model());
  const double sigma = 1e-3;
  UnknownTime unknown(flows, sigma, 2);
  const auto log_probability = [&](double gap) {
    Belief belief = belief_of(Eigen::Vector2d(gap - 0.1, -1.0), 1e-6 * Eigen::Matrix2d::Identity());
    Motion motion;
    flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
    return unknown.log_of_silence({UncertainEvent::Kind::pulse, 0, 0}, motion, {1.0, 1.0}, belief);
  };
  EXPECT_NEAR(log_probability(1e-2), 0.0, 1e-6);
  // It was at contact 1 sigma ago: a report that is as late as that or later.
  EXPECT_NEAR(std::exp(log_probability(-1e-3)), 0.1587, 0.003);
  EXPECT_NEAR(std::exp(log_probability(-2e-3)), 0.0228, 0.001);
  EXPECT_LT(log_probability(-2e-2), -24.5);
}

// So it is where its spring turns the machine back within reach of the jitter: on its way down or
// up again, with the top of its motion not far behind.
TEST(UnknownTime, SilenceOfAFastMachineIsAsLikelyAsAReportIsLate) {
  const double omega = 100.0, sigma = 1e-2;
  const Machine machine{Eigen::VectorXd::Constant(1, omega), Eigen::VectorXd::Constant(1, 0.01),
                        0.5};
  const Flows flows(machine.model());
  UnknownTime unknown(flows, sigma, 2);
  // At the support, one radian ahead of its lowest point.
  const Eigen::Vector2d closing(-0.1, -0.1 * omega * std::tan(1.0));
  Eigen::Matrix2d P = Eigen::Matrix2d::Zero();
  P.diagonal() << 1e-12, 1e-8;
  for (double late = 0.1; late < 1.95; late += 0.05) {
    Belief belief = belief_of(machine.flow(late * sigma) * closing, P);
    Motion motion;
    flows[0].enter(belief.q, belief.u, at(1.0), Eigen::VectorXd(), motion);
    const double log_probability =
        unknown.log_of_silence({UncertainEvent::Kind::pulse, 0, 0}, motion, {1.0, 1.0}, belief);
    EXPECT_NEAR(log_probability, log_normal_cdf(-late), 0.01) << late;
  }
}

// The n-th of a row takes what is left for it to take, not the share of restitution once more.
TEST(UnknownTime, BurstsTakeTheEnergyOfAChatter) {
  const Machine machine{Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, 0.01), 0.5};
  const Flows flows(machine.model());
  UnknownTime unknown(flows, 1e-3, 2);
  for (const int n : {1, 2, 30}) {
    for (const double gamma : {0.0, -0.7, 2.0}) {
      Belief belief =
          belief_of(Eigen::Vector2d(-0.1, gamma), Eigen::Matrix2d{{0.0, 0.0}, {0.0, 1.0}});
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
