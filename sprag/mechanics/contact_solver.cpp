#include "sprag/mechanics/contact_solver.h"

#include <bit>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

// Velocities and accelerations below this share of what they are the difference of are zero.
constexpr double zero_share = 1e-12;
// Rounding of gamma, as a share of its terms, and what is clearly more.
constexpr double rounding = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double pressed_share = 1e-9;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

ContactSolver::ContactSolver(const Flows& flows, DependentContacts dependent)
    : flows_(&flows), dependent_(dependent) {
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

ContactSet ContactSolver::parting(ContactSet contacts, const Motion& motion) const {
  ContactSet parting = 0;
  for_each(contacts, [&](int i) {
    const Signal& gamma = motion.flow->gap_velocity(i);
    const Oscillators& o = motion.flow->oscillators();
    const auto& [z, v] = motion.x;
    double scale = ((gamma.p * v).abs() + (gamma.r * motion.alpha).abs() +
                    (gamma.r * o.delta() * v).abs() + (gamma.r * o.kappa() * z).abs())
                       .sum();
    for (const Drive& drive : motion.flow->drives().all()) {
      scale += std::abs(gamma.r[drive.mode] * drive.force(motion.x));
    }
    if (std::abs(gap_velocity(i, motion)) <= pressed_share * velocity_scale(i, motion) &&
        std::abs(rate(gamma, motion)) <= pressed_share * scale &&
        second_rate(gamma, motion) > 0.0) {
      parting |= bit(i);
    }
  });
  return parting;
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

// The flow with these contacts locked; where there is none, with fewer of them.
const Flow& ContactSolver::flow_of(ContactSet locked) {
  if (dependent_ == DependentContacts::refuse) return (*flows_)[locked];
  const Flow* flow = flows_->find(locked);
  while (flow == nullptr) {
    const ContactSet last = std::bit_floor(locked);
    unsatisfied_ |= last;
    locked &= ~last;
    flow = flows_->find(locked);
  }
  return *flow;
}

void ContactSolver::enter(ContactSet locked, ContactSet geometric, Motion& motion) {
  const Flow& flow = flow_of(locked);
  Eigen::Index count = 0;
  for_each(flow.locked(),
           [&](int i) { held_locked_[count++] = contains(geometric, i) ? 0.0 : gap(i, motion); });
  flow.enter(state_.q, state_.u, motion.t, held_locked_.head(count), motion);
}

// 0 <= x _|_ y = A x + b >= 0, row by row for `contacts`.
Solved ContactSolver::solve(const ContactMatrix& A, const ContactVector& b,
                            const ContactVector& noise, ContactVector& x, ContactVector& y,
                            ContactSet contacts) {
  if (dependent_ == DependentContacts::refuse) return solve_lcp(A, b, x, y);
  ContactSet rows = 0;
  const Solved solved = solve_semidefinite_lcp(A, b, noise, x, y, rows);
  leave_out(rows, contacts);
  return solved;
}

void ContactSolver::leave_out(ContactSet rows, ContactSet contacts) {
  int row = 0;
  for_each(contacts, [&](int i) {
    if (contains(rows, row++)) unsatisfied_ |= bit(i);
  });
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
    if (solve(of_contacts(flows_->dynamics().G(), candidates), a, zero_share * magnitude, lambda,
              rate, candidates) != Solved::yes) {
      return Solved::dependent;
    }
    row = 0;
    // Neither pressed nor pulled apart: what touches goes on touching.
    for_each(candidates, [&](int i) {
      const double noise = zero_share * magnitude[row];
      if (rate[row] <= noise && !contains(unsatisfied_, i)) {
        locked |= bit(i);
        if (lambda[row] * flows_->dynamics().G()(i, i) <= noise) unloaded_ |= bit(i);
      }
      ++row;
    });
    if (dependent_ == DependentContacts::share) {
      const ContactSet pressed = locked & ~unloaded_;
      locked = pressed | independent_of(flows_->dynamics().G(), pressed, unloaded_);
      unloaded_ &= locked;
    }
  }
  enter(locked, geometric, motion);
  return Solved::yes;
}

// Sum of the terms of gamma_i.
double ContactSolver::velocity_scale(int contact, const Motion& motion) const {
  const Flow& flow = *motion.flow;
  if (contains(flow.locked(), contact)) return 0.0;
  const Signal& gamma = flow.gap_velocity(contact);
  return (gamma.p * motion.x.z).abs().sum() + (gamma.r * motion.x.v).abs().sum();
}

ContactSet ContactSolver::pressed_in(ContactSet contacts, const Motion& motion) const {
  ContactSet pressed = 0;
  for_each(contacts, [&](int i) {
    const double noise = pressed_share * velocity_scale(i, motion);
    if (gap_velocity(i, motion) < -noise) pressed |= bit(i);
  });
  return pressed;
}

Solved ContactSolver::collide(ContactSet closed, std::span<const double> epsilon,
                              ContactSet staying, ContactSet geometric, Motion& motion) {
  const Dynamics& dynamics = flows_->dynamics();
  const auto n = static_cast<Eigen::Index>(std::popcount(closed));
  ContactVector gamma_minus(n);
  ContactVector noise(n);
  ContactVector epsilon_A(n);
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    gamma_minus[row] = gap_velocity(i, motion);
    noise[row] = rounding * velocity_scale(i, motion);
    epsilon_A[row++] = epsilon[index(i)];
  });
  unsatisfied_ = unloaded_ = 0;
  ContactVector Lambda;
  ContactVector gamma_plus;
  const ContactMatrix G = of_contacts(dynamics.G(), closed);
  ContactSet rows = 0;
  const Solved solved =
      dependent_ == DependentContacts::refuse
          ? impact(dynamics.model().law, G, epsilon_A, gamma_minus, Lambda, gamma_plus)
          : semidefinite_impact(dynamics.model().law, G, epsilon_A, gamma_minus, noise, Lambda,
                                gamma_plus, rows);
  if (solved != Solved::yes) return solved;
  leave_out(rows, closed);
  const double scale = gamma_minus.cwiseAbs().maxCoeff();
  resting_ = 0;
  struck_ = 0;
  row = 0;
  for_each(closed, [&](int i) {
    if (std::abs(gamma_plus[row]) <= std::max(zero_share * scale, noise[row])) {
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
  unsatisfied_ = 0;
  read_state(motion);
  return enter_locked(candidates, geometric, motion);
}

void ContactSolver::release(ContactSet leaving, Motion& motion) {
  unsatisfied_ = 0;
  const ContactSet locked = motion.flow->locked();
  if ((locked & leaving) == 0) return;
  read_state(motion);
  enter(locked & ~leaving, 0, motion);
}

void ContactSolver::start(const State& state, Instant t, Motion& motion) {
  (*flows_)[0].enter(state.q, state.u, t, held_locked_.head(0), motion);
}

}  // namespace sprag
