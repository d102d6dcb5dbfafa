#include "sprag/detail/bound/error_bound.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/master.h"

namespace sprag {
namespace {

// Generous estimate of a state's rounding from one event to the next, in ulps.
constexpr double state_ulps = 64.0;
// Rounding of an event's time, in ulps; it moves a state by omega times as much.
constexpr double time_ulps = 4.0;

// The master holds contacts that open with a velocity of about their acceleration times a chatter's
// remainder, and moves touching contacts to their supports. Factor on both effects.
constexpr double tolerated = 8.0;
constexpr double window = 16.0;  // duration of a joint chatter, in remainders

double quadratic_form(const Eigen::MatrixXd& A, bool diagonal, const Eigen::VectorXd& x) {
  if (diagonal) return (A.diagonal().array() * x.array().square()).sum();
  double sum = 0.0;
  for (Eigen::Index j = 0; j < x.size(); ++j) sum += x[j] * A.col(j).dot(x);
  return sum;
}

/// Gap velocities of `contacts` in a motion, ascending.
ContactVector gap_velocities(ContactSet contacts, const Motion& motion) {
  ContactVector gamma(std::popcount(contacts));
  Eigen::Index row = 0;
  for_each(contacts, [&](int i) {
    const bool locked = contains(motion.flow->locked(), i);
    gamma[row++] = locked ? 0.0 : value(motion.flow->gap_velocity(i), motion);
  });
  return gamma;
}

/// Finds Lambda such that z + G Lambda is the nearest point to z with gamma >= 0, and gamma = 0 in
/// the rows `held`.
Solved to_rest(const ContactMatrix& G, ContactSet held, const ContactVector& z,
               ContactVector& Lambda) {
  const ContactSet all = bit(static_cast<int>(z.size())) - 1;
  const ContactSet rest = all & ~held;
  const auto h = static_cast<Eigen::Index>(std::popcount(held));
  const auto r = static_cast<Eigen::Index>(std::popcount(rest));
  const ContactMatrix G_held = of_contacts(G, held);
  ContactMatrix across(h, r);
  ContactVector z_held(h), z_rest(r), solved;
  Eigen::Index j = 0;
  for_each(rest, [&](int column) {
    Eigen::Index i = 0;
    for_each(held, [&](int row) { across(i++, j) = G(row, column); });
    z_rest[j++] = z[column];
  });
  Eigen::Index i = 0;
  for_each(held, [&](int row) { z_held[i++] = z[row]; });
  // Impulses on the held rows without impulses on the others, then with them.
  if (arrest(G_held, z_held, solved) != Solved::yes) return Solved::dependent;
  z_rest += across.transpose() * solved;
  ContactMatrix remaining = of_contacts(G, rest);
  for (j = 0; j < r; ++j) {
    if (arrest(G_held, across.col(j), solved) != Solved::yes) return Solved::dependent;
    remaining.col(j) += across.transpose() * solved;
  }
  ContactVector push, gamma;
  if (solve_lcp(remaining, z_rest, push, gamma) != Solved::yes) return Solved::dependent;
  if (arrest(G_held, z_held + across * push, solved) != Solved::yes) return Solved::dependent;
  Lambda.setZero(z.size());
  j = 0;
  for_each(rest, [&](int row) { Lambda[row] = push[j++]; });
  i = 0;
  for_each(held, [&](int row) { Lambda[row] = solved[i++]; });
  return Solved::yes;
}

/// Row numbers of the contacts `of` among the contacts `among`.
ContactSet rows_of(ContactSet of, ContactSet among) {
  ContactSet rows = 0;
  int row = 0;
  for_each(among, [&](int i) {
    if (contains(of, i)) rows |= bit(row);
    ++row;
  });
  return rows;
}

}  // namespace

bool law_is_masters(const Model& model) {
  return std::none_of(model.contacts.begin(), model.contacts.end(), [](const Contact& contact) {
    return contact.replica_restitution.has_value();
  });
}

bool law_is_monotone(const Model& model) {
  if (model.contacts.size() <= 1) return true;
  return model.law == ImpactLaw::poisson && has_one_restitution(model);
}

ErrorBound::ErrorBound(const Flows& flows)
    : flows_(&flows),
      guaranteed_(law_is_monotone(flows.dynamics().model()) &&
                  law_is_masters(flows.dynamics().model())),
      flight_(flows) {
  const Dynamics& dynamics = flows.dynamics();
  const CholeskyFactor M(dynamics.model().M);
  const auto in_energy = [&](const Eigen::VectorXd& force) { return M.solve_L(force).norm(); };
  force_ = in_energy(dynamics.force_constant());
  for (Eigen::Index j = 0; j < dynamics.frequencies().size(); ++j) {
    force_ += in_energy(dynamics.force_amplitudes().col(j).cwiseAbs());
    for (int i = 0; i < dynamics.contacts(); ++i) {
      const double Omega = dynamics.frequencies()[j];
      force_ += std::abs(dynamics.motion_amplitudes()(i, j)) * Omega * Omega /
                std::sqrt(dynamics.G()(i, i));
    }
  }
  const SampledInputs& inputs = dynamics.inputs();
  for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
    const double largest = inputs.channel(c).largest(2);
    force_ += in_energy(inputs.forces().col(c)) * largest;
    for (int i = 0; i < dynamics.contacts(); ++i) {
      force_ += std::abs(inputs.motions()(i, c)) * largest / std::sqrt(dynamics.G()(i, i));
    }
  }
  q_.setZero(dynamics.coordinates());
  u_.setZero(dynamics.coordinates());
}

void ErrorBound::start(const Motion& motion, ContactSet chi, ErrorBoundState& state) {
  state = {};
  state.started = state.free_since = motion.t;
  state.from_start = chi;
  note_energy(motion, state);
}

double ErrorBound::bound(const ErrorBoundState& state, double initial, Instant t, bool free) {
  const double tau = free ? t - state.free_since : 0.0;
  const double b =
      std::sqrt(flight_.square_at_node(tau)) * (std::sqrt(initial * state.share) + state.remainder);
  // sqrt(2 E) grows by the forces alone.
  const double moving = b + std::sqrt(state.energy) + force_ * tau;
  return square(b + state_ulps * machine_epsilon * moving);
}

void ErrorBound::event(ContactSet before, ContactSet closing, ContactSet chi,
                       std::span<const double> epsilon, const Motion& motion,
                       ErrorBoundState& state) {
  if (before == 0) {
    const double sigma2 = contraction(motion.t - state.free_since);
    state.share *= sigma2;
    state.remainder *= std::sqrt(sigma2);
  }
  if (chi == 0) state.free_since = motion.t;
  const bool at_start = motion.t - state.started == 0.0;
  state.from_start = at_start ? state.from_start | chi : state.from_start & chi;
  if (closing == 0) return;
  note_energy(motion, state);
  state.remainder += machine_epsilon * (state_ulps * std::sqrt(state.energy) +
                                        time_ulps * motion.t.hi * acceleration(state.energy));
  strike(before, closing, chi, epsilon, motion, state);
}

void ErrorBound::strike(ContactSet before, ContactSet closing, ContactSet chi,
                        std::span<const double> epsilon, const Motion& motion,
                        ErrorBoundState& state) const {
  const ContactSet closed = before | closing;
  const ContactSet held = closing & chi;
  if (!guaranteed_ || std::popcount(closed) < 2) return;
  const auto of = [&](int i) { return epsilon[static_cast<std::size_t>(i)]; };
  const double common = flows_->dynamics().model().contacts.front().restitution;
  const ContactMatrix G = of_contacts(flows_->dynamics().G(), closed);
  const ContactVector gamma = gap_velocities(closed, motion);
  ContactVector own(gamma.size());
  Eigen::Index row = 0;
  for_each(closed, [&](int i) { own[row++] = of(i); });
  ContactVector compression, Lambda, after;
  // Root of the energy between two results of this impact: by the replica's law, and by one
  // restitution for all contacts with `resting` brought to rest.
  const bool solved = solve_lcp(G, gamma, compression, after) == Solved::yes &&
                      impact(ImpactLaw::poisson, G, own, gamma, Lambda, after) == Solved::yes;
  if (solved) compression *= 1.0 + common;
  const auto departure = [&](ContactSet resting) {
    ContactVector arrested;
    if (!solved ||
        to_rest(G, rows_of(resting, closed), gamma + G * compression, arrested) != Solved::yes) {
      return infinity;
    }
    const ContactVector apart = Lambda - compression - arrested;
    return std::sqrt(std::max(0.5 * apart.dot(G * apart), 0.0));
  };

  const bool unlike = own.minCoeff() < own.maxCoeff();
  const ContactSet outside = ~state.from_start;
  const bool all_stay_beside_one = (closed & ~(chi & outside)) == 0 && std::popcount(held) == 1;
  double d = 0.0;
  if (unlike && !all_stay_beside_one) d = (held & ~outside) == 0 ? departure(held) : infinity;
  // The master may have held contacts that barely opened.
  const double share = tolerated * spread(closed);
  if (share == infinity) {
    state.remainder = infinity;
    return;
  }
  const double rest = chatter_rest(motion.t);
  const double pulled =
      std::min(departure(closed & chi & outside), d + share * rest * acceleration(state.energy));
  // Contacts of a joint chatter are completed with a remaining gap.
  const bool wedge = std::popcount(closing) > 1;
  const double gap = wedge ? window * rest * std::sqrt(2.0 * state.energy) : 0.0;
  state.remainder +=
      std::max(d, pulled) + share * flight_.omega_max() * (gap + shift(closed, motion));
}

// Gap velocities up to sqrt(G_ii) have an energy of 1/2 for one contact alone. For all contacts
// together their energy is at most the square of this, for all combinations of signs.
double ErrorBound::spread(ContactSet closed) const {
  ContactMatrix G = of_contacts(flows_->dynamics().G(), closed);
  const ContactVector root = G.diagonal().cwiseSqrt();
  G.array().colwise() /= root.array();
  G.array().rowwise() /= root.transpose().array();
  const Eigen::LLT<ContactMatrix> factor(G);
  if (factor.info() != Eigen::Success) return infinity;
  ContactMatrix inverse = ContactMatrix::Identity(G.rows(), G.rows());
  factor.matrixL().solveInPlace(inverse);
  return std::sqrt(0.5 * static_cast<double>(G.rows())) * inverse.norm();
}

// Largest distance by which the master moves a touching contact to its support.
double ErrorBound::shift(ContactSet closed, const Motion& motion) const {
  double largest = 0.0;
  for_each(closed & ~motion.flow->locked(), [&](int i) {
    const Signal& g = motion.flow->gap(i);
    const double terms =
        std::abs(g.constant) + (g.p * motion.x.z).abs().sum() + (g.r * motion.x.v).abs().sum();
    largest = std::max(largest, touching * terms / std::sqrt(flows_->dynamics().G()(i, i)));
  });
  return largest;
}

double ErrorBound::chatter_rest(Instant t) const {
  return flows_->dynamics().model().chatter_time + resolvable * t.hi;
}

double ErrorBound::acceleration(double energy) const {
  return force_ + (flight_.omega_max() + flight_.damping()) * std::sqrt(2.0 * energy);
}

void ErrorBound::note_energy(const Motion& motion, ErrorBoundState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = dynamics.model();
  motion.flow->state(motion, q_, u_);
  state.energy = std::max(state.energy, 0.5 * (quadratic_form(model.M, dynamics.diagonal(), u_) +
                                               quadratic_form(model.K, dynamics.diagonal(), q_)));
}

namespace {

bool has_noisy_inputs(const Model& model) {
  return std::any_of(model.forces.begin(), model.forces.end(), [](const Force& force) {
    return force.input && (force.input->noise() > 0.0 || force.input->is_streamed());
  });
}

}  // namespace

double initial_bound(const Scene& scene) {
  const bool exact = scene.prior.tolerance.any() ||
                     (scene.prior.jitter == 0.0 && scene.prior.drift == 0.0 &&
                      scene.prior.parameters.empty() && !has_noisy_inputs(scene.model));
  return scene.prior.uncertainty.size() > 0 && exact ? scene.prior.uncertainty.sum()
                                                     : std::numeric_limits<double>::infinity();
}

}  // namespace sprag
