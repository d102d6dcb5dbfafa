#include "sprag/detail/mechanics/contact_solver.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// A velocity or acceleration below this fraction of the terms it is computed from counts as zero.
constexpr double zero_share = 1e-12;
// Rounding error of gamma as a fraction of its terms, and a fraction clearly above it.
constexpr double rounding = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double pressed_share = 1e-9;

// Converts row numbers to contacts: row k belongs to the k-th contact of `contacts` by number.
ContactSet at_rows(ContactSet rows, ContactSet contacts) {
  ContactSet set = 0;
  int row = 0;
  for_each(contacts, [&](int i) {
    if (contains(rows, row++)) set |= bit(i);
  });
  return set;
}

}  // namespace

ContactSolver::ContactSolver(const Flows& flows, DependentContacts dependent)
    : flows_(&flows), dependent_(dependent) {
  const Dynamics& dynamics = flows.dynamics();
  const int m = dynamics.contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(dynamics.free_acceleration(i));
  state_.q.resize(dynamics.coordinates());
  state_.u.resize(dynamics.coordinates());
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
    if (const SampledResponse* sampled = motion.flow->sampled()) {
      for (Eigen::Index k = 0; k < sampled->modes(); ++k) {
        scale += std::abs(gamma.r[sampled->first_mode() + k] * sampled->force(k, motion.x)[0]);
      }
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
  for (Eigen::Index j = 0; 2 * j < a.chain.size(); ++j) {
    add(a.chain[2 * j] * motion.x.z[Omega.size() + j]);
    add(a.chain[2 * j + 1] * motion.x.v[Omega.size() + j]);
  }
  return sum;
}

void ContactSolver::read_state(const Motion& motion) {
  motion.flow->state(motion, state_.q, state_.u);
}

// The flow with `locked` locked. If there is none and dependent contacts are shared, contacts are
// removed, the highest number first, until there is one; the removed ones become unsatisfied.
const Flow& ContactSolver::flow_of(ContactSet locked, ContactSet& unsatisfied) const {
  if (dependent_ == DependentContacts::refuse) return (*flows_)[locked];
  const Flow* flow = flows_->find(locked);
  while (flow == nullptr) {
    const ContactSet last = std::bit_floor(locked);
    unsatisfied |= last;
    locked &= ~last;
    flow = flows_->find(locked);
  }
  return *flow;
}

void ContactSolver::enter(ContactSet locked, ContactSet geometric, ContactSet& unsatisfied,
                          Motion& motion) {
  const Flow& flow = flow_of(locked, unsatisfied);
  Eigen::Index count = 0;
  for_each(flow.locked(),
           [&](int i) { held_locked_[count++] = contains(geometric, i) ? 0.0 : gap(i, motion); });
  // A static deflection removes the residual gaps of contacts in `geometric`, in the master in the
  // same way as in the estimators.
  flow.close_gaps(geometric, motion.t, state_.q);
  flow.enter(state_.q, state_.u, motion.t, held_locked_.head(count), motion);
}

// Solves 0 <= lambda _|_ gamma' >= 0 on `candidates`. Returns those with gamma' = 0, without those
// that `locking` already lists as unsatisfied or that become unsatisfied here.
ContactSet ContactSolver::choose(ContactSet candidates, const Motion& motion,
                                 Locking& locking) const {
  const Eigen::MatrixXd& G = flows_->dynamics().G();
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
  const ContactMatrix A = of_contacts(G, candidates);
  if (dependent_ == DependentContacts::refuse) {
    locking.solved = solve_lcp(A, a, lambda, rate);
  } else {
    ContactSet rows = 0;
    locking.solved = solve_semidefinite_lcp(A, a, zero_share * magnitude, lambda, rate, rows);
    locking.unsatisfied |= at_rows(rows, candidates);
  }
  if (locking.solved != Solved::yes) return 0;

  ContactSet locked = 0;
  row = 0;
  // A contact with lambda = gamma' = 0 stays locked, so that a resting contact does not open by
  // rounding.
  for_each(candidates, [&](int i) {
    const double noise = zero_share * magnitude[row];
    if (rate[row] <= noise && !contains(locking.unsatisfied, i)) {
      locked |= bit(i);
      if (lambda[row] * G(i, i) <= noise) locking.unloaded |= bit(i);
    }
    ++row;
  });
  if (dependent_ == DependentContacts::share) {
    const ContactSet pressed = locked & ~locking.unloaded;
    locked = pressed | independent_of(G, pressed, locking.unloaded);
    locking.unloaded &= locked;
  }
  return locked;
}

// Requires q, u at motion.t in state_. `motion` supplies the phases and the gaps.
Locking ContactSolver::enter_locked(ContactSet candidates, ContactSet geometric,
                                    ContactSet unsatisfied, Motion& motion) {
  Locking locking{Solved::yes, 0, unsatisfied};
  const ContactSet locked = candidates == 0 ? 0 : choose(candidates, motion, locking);
  if (locking.solved == Solved::yes) enter(locked, geometric, locking.unsatisfied, motion);
  return locking;
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

Collision ContactSolver::collide(ContactSet closed, std::span<const double> epsilon,
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
  ContactVector Lambda;
  ContactVector gamma_plus;
  const ContactMatrix G = of_contacts(dynamics.G(), closed);
  ContactSet rows = 0;
  Collision collision;
  collision.closed = closed;
  collision.solved =
      dependent_ == DependentContacts::refuse
          ? impact(dynamics.model().law, G, epsilon_A, gamma_minus, Lambda, gamma_plus)
          : semidefinite_impact(dynamics.model().law, G, epsilon_A, gamma_minus, noise, Lambda,
                                gamma_plus, rows);
  if (collision.solved != Solved::yes) return collision;
  collision.unsatisfied = at_rows(rows, closed);
  collision.gamma_plus.setZero(dynamics.contacts());
  const double scale = gamma_minus.cwiseAbs().maxCoeff();
  row = 0;
  for_each(closed, [&](int i) {
    if (std::abs(gamma_plus[row]) <= std::max(zero_share * scale, noise[row])) {
      gamma_plus[row] = 0.0;
      collision.resting |= bit(i);
    }
    if (Lambda[row] > 0.0) collision.struck |= bit(i);
    collision.gamma_plus[i] = gamma_plus[row++];
  });

  row = 0;
  const Flow& flow = *motion.flow;
  if (flow.locked() == 0 && (collision.resting & staying) == 0 && flow.accepts_kicks()) {
    for_each(closed, [&](int i) { flow.kick(i, Lambda[row++], motion); });
    return collision;
  }
  read_state(motion);
  for_each(closed, [&](int i) { state_.u += Lambda[row++] * dynamics.MinvW().col(i); });
  Locking& locking = collision;
  locking = enter_locked(collision.resting & staying, geometric, collision.unsatisfied, motion);
  return collision;
}

Collision ContactSolver::hold(const Collision& collision, ContactSet contacts, ContactSet geometric,
                              Motion& motion) {
  const Dynamics& dynamics = flows_->dynamics();
  Collision held = collision;
  held.resting |= contacts;
  ContactVector Lambda;
  ContactSet pressed = 0;
  do {
    held.resting |= pressed;
    ContactVector gamma(std::popcount(held.resting));
    Eigen::Index row = 0;
    for_each(held.resting, [&](int i) { gamma[row++] = collision.gamma_plus[i]; });
    held.solved = arrest(of_contacts(dynamics.G(), held.resting), gamma, Lambda);
    if (held.solved != Solved::yes) return held;
    pressed = 0;
    for_each(held.closed & ~held.resting, [&](int i) {
      double sum = collision.gamma_plus[i];
      Eigen::Index k = 0;
      for_each(held.resting, [&](int j) { sum += dynamics.G()(i, j) * Lambda[k++]; });
      held.gamma_plus[i] = sum;
      if (sum <= 0.0) pressed |= bit(i);
    });
  } while (pressed != 0);

  read_state(motion);
  Eigen::Index row = 0;
  for_each(held.resting, [&](int i) {
    state_.u += Lambda[row++] * dynamics.MinvW().col(i);
    held.gamma_plus[i] = 0.0;
  });
  Locking& locking = held;
  locking = enter_locked(held.resting, geometric, collision.unsatisfied, motion);
  return held;
}

Locking ContactSolver::lock(ContactSet candidates, ContactSet geometric, Motion& motion) {
  read_state(motion);
  return enter_locked(candidates, geometric, 0, motion);
}

ContactSet ContactSolver::release(ContactSet leaving, Motion& motion) {
  const ContactSet locked = motion.flow->locked();
  ContactSet unsatisfied = 0;
  if ((locked & leaving) == 0) return unsatisfied;
  read_state(motion);
  enter(locked & ~leaving, 0, unsatisfied, motion);
  return unsatisfied;
}

void ContactSolver::start(const State& state, Instant t, Motion& motion) {
  (*flows_)[0].enter(state.q, state.u, t, held_locked_.head(0), motion);
}

}  // namespace sprag
