// Machines in free flight with one signal to search, and a dense scan for its first root.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"

namespace sprag {

// A machine in free flight and one signal of it.
struct Problem {
  explicit Problem(Model model)
      : dynamics(std::make_unique<Dynamics>(std::move(model))),
        flow(std::make_unique<Flow>(*dynamics, 0)),
        start(std::make_unique<Motion>()) {}

  void enter(const State& state, double t) {
    flow->enter(state.q, state.u, at(t), Eigen::VectorXd(0), *start);
  }

  std::unique_ptr<Dynamics> dynamics;
  std::unique_ptr<Flow> flow;
  std::unique_ptr<Motion> start;
  Signal signal;
  double sign = 1.0;

  Motion moved(double tau) const {
    Motion motion;
    flow->propagate(*start, start->t + tau, motion);
    return motion;
  }
  double phi(double tau) const { return sign * value(signal, moved(tau)); }
  double slope(double tau) const { return sign * rate(signal, moved(tau)); }

  // Sum of the magnitudes of phi's terms.
  double magnitude(const Motion& motion) const {
    return std::abs(signal.constant) + (signal.p * motion.x.z).abs().sum() +
           (signal.r * motion.x.v).abs().sum();
  }
  // Rounding error of phi(tau): that of its terms, their phases, and tau itself.
  double rounding(double tau) const {
    const Motion motion = moved(tau);
    const Eigen::ArrayXd phase = 1.0 + flow->oscillators().root_kappa() * tau;
    const double terms = std::abs(signal.constant) + (signal.p * motion.x.z).abs().sum() +
                         (signal.r * motion.x.v).abs().sum() +
                         (phase * (signal.p * start->x.z).abs()).sum() +
                         (phase * (signal.r * start->x.v).abs()).sum();
    const double t = std::max(std::abs(start->t.hi) + tau, 1e-3);
    return 8.0 * machine_epsilon * terms +
           2.0 * machine_epsilon * t * std::abs(rate(signal, motion));
  }
};

// First time in (0, T] with phi below -margin, by samples at a distance h; minima between two
// samples are located. Also the least value.
struct Scan {
  double first = infinity;  // phi < -margin here
  double before = 0.0;      // and not yet here
  double least = infinity;
  double at_least = 0.0;
};

inline Scan scan(const Problem& problem, double T, double h, double margin, bool stop = true) {
  const TickTable table(problem.flow->oscillators(), h);
  const DriveTable driven(problem.flow->oscillators(), problem.flow->drives(), h);
  Motion here = *problem.start;
  Scan result;
  double phi = problem.sign * value(problem.signal, here);
  double slope = problem.sign * rate(problem.signal, here);
  const auto look = [&](double tau, double value, double before) {
    if (value < result.least) {
      result.least = value;
      result.at_least = tau;
    }
    if (value < -margin && tau < result.first) {
      result.first = tau;
      result.before = before;
    }
  };
  const auto samples = static_cast<int>(std::round(T / h));
  for (int k = 1; k <= samples && !(stop && result.first < infinity); ++k) {
    table.rotate(here.x);
    table.push(here.alpha, here.x);
    driven.apply(here.x);
    const double last_phi = phi;
    const double last_slope = slope;
    phi = problem.sign * value(problem.signal, here);
    slope = problem.sign * rate(problem.signal, here);
    const double left = (k - 1) * h;
    if (last_slope < 0.0 && slope > 0.0 &&
        last_phi + last_slope * h < std::min(result.least, 1.0) + margin) {
      double low = left;
      double high = k * h;
      while (high - low > 1e-15 * (1.0 + high)) {
        const double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) break;
        (problem.slope(middle) < 0.0 ? low : high) = middle;
      }
      look(low, problem.phi(low), left);
    }
    look(k * h, phi, left);
  }
  return result;
}

// The root between scan.before and scan.first.
inline double bisect(const Problem& problem, const Scan& scan) {
  double low = scan.before;
  double high = scan.first;
  for (int i = 0; i < 200 && high - low > machine_epsilon * high; ++i) {
    const double middle = 0.5 * (low + high);
    (problem.phi(middle) > 0.0 ? low : high) = middle;
  }
  return high;
}

inline Model diagonal_machine(Random& random, Eigen::Index f, double slowest, double fastest) {
  Eigen::VectorXd mass(f);
  Eigen::VectorXd damping(f);
  Eigen::VectorXd stiffness(f);
  for (Eigen::Index i = 0; i < f; ++i) {
    mass[i] = random.uniform(0.5, 2.0);
    const double w = random.log_uniform(slowest, fastest);
    double ratio = 0.0;  // of the damping to the critical one
    switch (random.integer(0, 4)) {
      case 0:
        break;
      case 1:
        ratio = random.log_uniform(1e-4, 1e-1);
        break;
      case 2:
        ratio = random.uniform(0.1, 1.0);
        break;
      case 3:
        ratio = random.uniform(1.0, 3.0);
        break;
      default:
        ratio = random.log_uniform(1e-3, 1e-2);
        break;
    }
    stiffness[i] = random.chance(0.05) ? 0.0 : mass[i] * w * w;
    damping[i] = 2.0 * mass[i] * ratio * w;
  }
  Model model;
  model.M = mass.asDiagonal();
  model.C = damping.asDiagonal();
  model.K = stiffness.asDiagonal();
  return model;
}

inline Harmonic harmonic(Random& random, double fastest) {
  return {random.uniform(-1, 1), random.log_uniform(0.5, fastest), random.phase()};
}

// A gap, a gap velocity or a linear combination of both, of a machine with 1 to 6 modes. `resonant`
// machines are driven at or near the frequency of a mode with almost no damping.
inline Problem random_problem(Random& random, double fastest = 60.0, bool resonant = false) {
  const Eigen::Index f = random.integer(1, 6);
  Model model = diagonal_machine(random, f, 0.5, fastest);
  for (int i = random.integer(0, 2); i > 0; --i) {
    model.forces.push_back({random.vector(f), random.uniform(-2, 2), harmonic(random, fastest)});
  }
  if (resonant) {
    const Eigen::Index i = random.integer(0, static_cast<int>(f) - 1);
    const double w = std::sqrt(model.K(i, i) / model.M(i, i));
    model.C(i, i) = random.chance(0.5) ? 0.0 : model.M(i, i) * w * random.log_uniform(1e-12, 1e-2);
    const double off = random.chance(0.3) ? 0.0 : random.log_uniform(1e-13, 1e-2);
    const double amplitude = random.log_uniform(1e-3, 3.0) * std::max(w * w, 1.0);
    const double Omega = w > 0.0 ? w * (1.0 + off) : 1.0;
    model.forces.push_back({Eigen::VectorXd::Unit(f, i), 0.0, {amplitude, Omega, random.phase()}});
  }
  Contact contact;
  contact.w = random.vector(f);
  contact.clearance = random.uniform(-1, 1);
  if (random.chance(0.7)) contact.motion = harmonic(random, fastest);
  model.contacts.push_back(contact);

  const double t = random.chance(0.5) ? 0.0 : random.uniform(0.0, 400.0);
  State state{random.vector(f), random.vector(f)};
  state.u *= random.log_uniform(0.1, 10.0);
  Problem problem(std::move(model));
  problem.enter(state, t);
  switch (random.integer(0, 2)) {
    case 0:
      problem.signal = problem.flow->gap(0);
      break;
    case 1:
      problem.signal = problem.flow->gap_velocity(0);
      break;
    default:
      Functional both = problem.dynamics->gap(0);
      both.b = random.vector(f) / 10.0;
      problem.signal = problem.flow->signal(both);
      break;
  }
  problem.sign = random.chance(0.8) ? 1.0 : -1.0;
  return problem;
}

inline void shift_to(Problem& problem, double phi_0) {
  // Twice, because the first time phi is rounded relative to the constant that cancels.
  for (int i = 0; i < 2; ++i) problem.signal.constant += problem.sign * (phi_0 - problem.phi(0.0));
}

struct Found {
  std::optional<double> tau;
  double certified;
};

inline Found search(const Problem& problem, double T, int order = 0) {
  EventSearch search;
  const Watch watch{&problem.signal, problem.sign, order, 0};
  search.begin(*problem.start, {&watch, 1});
  search.advance(T);
  if (search.found() && search.tau() <= T) return {search.tau(), search.certified()};
  return {std::nullopt, search.certified()};
}

struct Tally {
  int found = 0, none = 0;
  double worst_residual = 0.0;  // in units of Problem::rounding
};

// The result is a root to rounding accuracy with a falling signal, and the scan finds none before
// it.
inline void check_first_root(const Problem& problem, const Found& found, double T, double h,
                             Tally& tally) {
  double margin = 0.0;
  for (int k = 0; k <= 4; ++k) margin = std::max(margin, problem.rounding(0.25 * k * T));
  const Scan seen = scan(problem, T, h, margin);
  if (!found.tau) {
    ++tally.none;
    EXPECT_EQ(seen.first, infinity) << "missed: phi = " << problem.phi(seen.first) << " at "
                                    << seen.first << ", certified to " << found.certified;
    EXPECT_GT(found.certified, T);
    return;
  }
  ++tally.found;
  const double tau = *found.tau;
  const double residual = std::abs(problem.phi(tau)) / problem.rounding(tau);
  tally.worst_residual = std::max(tally.worst_residual, residual);
  EXPECT_LE(residual, 1.0) << "not a root: phi = " << problem.phi(tau) << " at " << tau;
  if (seen.first < infinity) {
    const double root = bisect(problem, seen);
    EXPECT_LE(tau, root + 2.0 * margin / std::max(std::abs(problem.slope(root)), 1e-6) +
                       4.0 * machine_epsilon * (1.0 + root))
        << "missed one at " << root;
  }
  // A falling signal: the next values are below zero, except for a tangential root within rounding.
  const double ahead = 1e-3 * h;
  EXPECT_LE(problem.phi(tau + ahead), 2.0 * margin + ahead * ahead * 1e6) << "rises at " << tau;
}

}  // namespace sprag
