#include "mechanics/contact_solver.h"

#include <bit>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

// Velocities and accelerations below this share of what they are the difference of are zero.
constexpr double zero_share = 1e-12;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

ContactSolver::ContactSolver(const Flows& flows) : flows_(&flows) {
  const Dynamics& dynamics = flows.dynamics();
  const int m = dynamics.contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(dynamics.free_acceleration(i));
  state_.q.resize(dynamics.coordinates());
  state_.u.resize(dynamics.coordinates());
  gamma_plus_.resize(index(m));
  held_.resize(index(m));
  held_locked_.resize(m);
}

double ContactSolver::gap(int contact, const Motion& motion) const {
  const ContactSet locked = motion.flow->locked();
  if (!contains(locked, contact)) return value(motion.flow->gap(contact), motion);
  return motion.held[std::popcount(locked & (bit(contact) - 1))];
}

double ContactSolver::gap_velocity(int contact, const Motion& motion) const {
  if (contains(motion.flow->locked(), contact)) return 0.0;
  return value(motion.flow->gap_velocity(contact), motion);
}

double ContactSolver::acceleration(int contact, const Motion& motion, double& magnitude) const {
  const Functional& a = acceleration_[index(contact)];
  double sum = a.constant;
  magnitude = std::abs(a.constant);
  const auto add = [&](double term) {
    sum += term;
    magnitude += std::abs(term);
  };
  for (Eigen::Index k = 0; k < a.a.size(); ++k) {
    add(a.a[k] * state_.q[k]);
    add(a.b[k] * state_.u[k]);
  }
  const Eigen::VectorXd& Omega = flows_->dynamics().frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    add(a.h[j].real() * motion.x.z[j]);
    add(a.h[j].imag() / Omega[j] * motion.x.v[j]);
  }
  return sum;
}

void ContactSolver::read_state(const Motion& motion) {
  motion.flow->state(motion, state_.q, state_.u);
}

double ContactSolver::free_acceleration(int contact, const Motion& motion) {
  read_state(motion);
  double magnitude = 0.0;
  return acceleration(contact, motion, magnitude);
}

void ContactSolver::enter(ContactSet locked, ContactSet geometric, Motion& motion) {
  Eigen::Index count = 0;
  for_each(locked,
           [&](int i) { held_locked_[count++] = contains(geometric, i) ? 0.0 : gap(i, motion); });
  (*flows_)[locked].enter(state_.q, state_.u, motion.t, held_locked_.head(count), motion);
}

// Uses state_ as q, u at motion.t; motion still carries the phases and the gaps.
Solved ContactSolver::enter_locked(ContactSet candidates, ContactSet geometric, Motion& motion) {
  ContactSet locked = 0;
  unloaded_ = 0;
  if (candidates != 0) {
    const auto n = static_cast<Eigen::Index>(std::popcount(candidates));
    ContactVector a(n);
    ContactVector magnitude(n);
    Eigen::Index row = 0;
    for_each(candidates, [&](int i) {
      a[row] = acceleration(i, motion, magnitude[row]);
      ++row;
    });
    ContactVector lambda;
    ContactVector rate;
    if (solve_lcp(of_contacts(flows_->dynamics().G(), candidates), a, lambda, rate) != Solved::yes)
      return Solved::dependent;
    row = 0;
    // Neither pressed nor pulled apart: what touches goes on touching.
    for_each(candidates, [&](int i) {
      const double noise = zero_share * magnitude[row];
      if (rate[row] <= noise) {
        locked |= bit(i);
        if (lambda[row] * flows_->dynamics().G()(i, i) <= noise) unloaded_ |= bit(i);
      }
      ++row;
    });
  }
  enter(locked, geometric, motion);
  return Solved::yes;
}

// Rounding of gamma_i.
double ContactSolver::velocity_noise(int contact, const Motion& motion) const {
  const Flow& flow = *motion.flow;
  if (contains(flow.locked(), contact)) return 0.0;
  const Signal& gamma = flow.gap_velocity(contact);
  return 4.0 * std::numeric_limits<double>::epsilon() *
         ((gamma.p * motion.x.z).abs().sum() + (gamma.r * motion.x.v).abs().sum());
}

Solved ContactSolver::collide(ContactSet closed, std::span<const double> epsilon,
                              ContactSet staying, ContactSet geometric, Motion& motion) {
  const Dynamics& dynamics = flows_->dynamics();
  const auto n = static_cast<Eigen::Index>(std::popcount(closed));
  ContactVector gamma_minus(n);
  ContactVector epsilon_A(n);
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    gamma_minus[row] = gap_velocity(i, motion);
    epsilon_A[row++] = epsilon[index(i)];
  });
  ContactVector Lambda;
  ContactVector gamma_plus;
  if (impact(dynamics.model().law, of_contacts(dynamics.G(), closed), epsilon_A, gamma_minus,
             Lambda, gamma_plus) != Solved::yes) {
    return Solved::dependent;
  }
  const double scale = gamma_minus.cwiseAbs().maxCoeff();
  resting_ = 0;
  struck_ = 0;
  row = 0;
  for_each(closed, [&](int i) {
    if (std::abs(gamma_plus[row]) <= std::max(zero_share * scale, velocity_noise(i, motion))) {
      gamma_plus[row] = 0.0;
      resting_ |= bit(i);
    }
    if (Lambda[row] > 0.0) struck_ |= bit(i);
    gamma_plus_[index(i)] = gamma_plus[row++];
  });

  row = 0;
  const Flow& flow = *motion.flow;
  if (flow.locked() == 0 && (resting_ & staying) == 0 && flow.accepts_kicks()) {
    for_each(closed, [&](int i) { flow.kick(i, Lambda[row++], motion); });
    return Solved::yes;
  }
  read_state(motion);
  for_each(closed, [&](int i) { state_.u += Lambda[row++] * dynamics.MinvW().col(i); });
  return enter_locked(resting_ & staying, geometric, motion);
}

Solved ContactSolver::hold(ContactSet contacts, ContactSet closed, ContactSet geometric,
                           Motion& motion) {
  const Dynamics& dynamics = flows_->dynamics();
  while (true) {
    ContactVector gamma(std::popcount(contacts));
    Eigen::Index row = 0;
    for_each(contacts, [&](int i) { gamma[row++] = gamma_plus_[index(i)]; });
    ContactVector Lambda;
    if (arrest(of_contacts(dynamics.G(), contacts), gamma, Lambda) != Solved::yes)
      return Solved::dependent;
    const auto gamma_held = [&](int i) {
      double sum = gamma_plus_[index(i)];
      Eigen::Index k = 0;
      for_each(contacts, [&](int j) { sum += dynamics.G()(i, j) * Lambda[k++]; });
      return sum;
    };
    ContactSet pressed = 0;
    for_each(closed & ~contacts, [&](int i) {
      if (gamma_held(i) <= 0.0) pressed |= bit(i);
    });
    if (pressed != 0) {
      contacts |= pressed;
      continue;
    }
    read_state(motion);
    row = 0;
    for_each(contacts, [&](int i) { state_.u += Lambda[row++] * dynamics.MinvW().col(i); });
    if (const Solved solved = enter_locked(contacts, geometric, motion); solved != Solved::yes) {
      return solved;
    }
    for_each(closed & ~contacts, [&](int i) { gamma_plus_[index(i)] = gamma_held(i); });
    for_each(contacts, [&](int i) { gamma_plus_[index(i)] = 0.0; });
    resting_ = contacts;
    return Solved::yes;
  }
}

Solved ContactSolver::lock(ContactSet candidates, ContactSet geometric, Motion& motion) {
  read_state(motion);
  return enter_locked(candidates, geometric, motion);
}

void ContactSolver::release(ContactSet leaving, Motion& motion) {
  const ContactSet locked = motion.flow->locked();
  if ((locked & leaving) == 0) return;
  read_state(motion);
  ContactSet remaining = locked & ~leaving;
  Eigen::Index count = 0;
  for_each(remaining, [&](int i) { held_locked_[count++] = gap(i, motion); });
  (*flows_)[remaining].enter(state_.q, state_.u, motion.t, held_locked_.head(count), motion);
}

void ContactSolver::start(const State& state, Instant t, Motion& motion) {
  (*flows_)[0].enter(state.q, state.u, t, held_locked_.head(0), motion);
}

}  // namespace sprag
