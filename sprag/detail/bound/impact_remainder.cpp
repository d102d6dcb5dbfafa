#include "sprag/detail/bound/impact_remainder.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/bound/event_cost.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// The master holds contacts that open with a velocity of about their acceleration times a chatter's
// remainder, and moves touching contacts to their supports. Factor on both effects.
constexpr double tolerated = 8.0;
constexpr double joint_chatter = 16.0;  // duration of a joint chatter, in remainders

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

ContactVector gap_velocities(ContactSet contacts, const Motion& motion) {
  ContactVector gamma(std::popcount(contacts));
  Eigen::Index row = 0;
  for_each(contacts, [&](int i) {
    const bool locked = contains(motion.flow->locked(), i);
    gamma[row++] = locked ? 0.0 : value(motion.flow->gap_velocity(i), motion);
  });
  return gamma;
}

ImpactRemainder::ImpactRemainder(const EnergyMetric& metric)
    : metric_(&metric),
      monotone_(law_is_monotone(metric.dynamics().model())),
      force_(std::sqrt(2.0) * metric.push() + std::sqrt(0.5) * metric.support_step()) {}

void ImpactRemainder::start(const Motion& motion, const ModalState& state, ContactSet chi) {
  started_ = motion.t;
  from_start_ = chi;
  energy_ = sprag::energy(*metric_, state);
}

double ImpactRemainder::of(const ImpactContacts& contacts, const Motion& motion,
                           const ModalState& state) {
  const bool at_start = motion.t - started_ == 0.0;
  from_start_ = at_start ? from_start_ | contacts.after : from_start_ & contacts.after;
  if (contacts.closing == 0) return 0.0;
  energy_ = std::max(energy_, sprag::energy(*metric_, state));
  return state_share_of_rounding * std::sqrt(energy_) +
         time_share_of_rounding * motion.t.hi * acceleration() + at_several(contacts, motion);
}

double ImpactRemainder::at_several(const ImpactContacts& contacts, const Motion& motion) const {
  const ContactSet closed = contacts.before | contacts.closing;
  const ContactSet held = contacts.closing & contacts.after;
  if (!monotone_ || std::popcount(closed) < 2) return 0.0;
  const Model& model = metric_->dynamics().model();
  const double common = model.contacts.front().restitution;
  const ContactMatrix G = of_contacts(metric_->dynamics().G(), closed);
  const ContactVector gamma = gap_velocities(closed, motion);
  ContactVector own(gamma.size());
  Eigen::Index row = 0;
  for_each(closed, [&](int i) { own[row++] = contains(contacts.staying, i) ? 0.0 : common; });
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
  const ContactSet outside = ~from_start_;
  const bool all_stay_beside_one =
      (closed & ~(contacts.after & outside)) == 0 && std::popcount(held) == 1;
  double d = 0.0;
  if (unlike && !all_stay_beside_one) d = (held & ~outside) == 0 ? departure(held) : infinity;
  // The master may have held contacts that barely opened.
  const double share =
      tolerated * std::sqrt(0.5) * restitution_spread(metric_->dynamics().G(), closed);
  if (share == infinity) return infinity;
  const double rest = model.chatter_time + resolvable * motion.t.hi;  // of a chatter
  const double pulled =
      std::min(departure(closed & contacts.after & outside), d + share * rest * acceleration());
  // Contacts of a joint chatter are completed with a remaining gap.
  const bool wedge = std::popcount(contacts.closing) > 1;
  const double gap = wedge ? joint_chatter * rest * std::sqrt(2.0 * energy_) : 0.0;
  return std::max(d, pulled) + share * metric_->omega_max() * (gap + shift(closed, motion));
}

// Largest distance by which the master moves a touching contact to its support.
double ImpactRemainder::shift(ContactSet closed, const Motion& motion) const {
  double largest = 0.0;
  for_each(closed & ~motion.flow->locked(), [&](int i) {
    const Signal& g = motion.flow->gap(i);
    const double terms =
        std::abs(g.constant) + (g.p * motion.x.z).abs().sum() + (g.r * motion.x.v).abs().sum();
    largest = std::max(largest, touching * terms / std::sqrt(metric_->dynamics().G()(i, i)));
  });
  return largest;
}

double ImpactRemainder::acceleration() const {
  return force_ + metric_->rate() * std::sqrt(2.0 * energy_);
}

}  // namespace sprag
