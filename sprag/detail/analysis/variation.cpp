#include "sprag/detail/analysis/variation.h"

#include <bit>
#include <cmath>
#include <string>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {
namespace {

const Contact& contact_of(const Model& model, int i) {
  return model.contacts[static_cast<std::size_t>(i)];
}

// G_BB x_B = -b_B on the rows of B, x = 0 elsewhere.
void solve_branch(const ContactMatrix& G, ContactSet rows, const ContactVector& b,
                  ContactVector& x) {
  x.setZero(b.size());
  ContactVector b_B(std::popcount(rows)), x_B;
  Eigen::Index k = 0;
  for_each(rows, [&](int i) { b_B[k++] = b[i]; });
  if (k == 0 || arrest(of_contacts(G, rows), b_B, x_B) != Solved::yes) return;
  k = 0;
  for_each(rows, [&](int i) { x[i] = x_B[k++]; });
}

ContactSet positive(const ContactVector& x) {
  ContactSet rows = 0;
  for (int i = 0; i < x.size(); ++i) rows |= x[i] > 0.0 ? bit(i) : 0;
  return rows;
}

}  // namespace

Variation::Variation(Master& master, Eigen::Index columns)
    : master_(master), dynamics_(master.flows().dynamics()) {
  const Eigen::Index f = dynamics_.coordinates();
  q_.setZero(f, columns);
  u_.setZero(f, columns);
  z_.setZero(f, columns);
  v_.setZero(f, columns);
  position_.resize(f);
  u_minus_.resize(f);
  u_plus_.resize(f);
  du_.resize(f);
  acceleration_.resize(f);
  delays_.resize(columns);
  const Model& model = dynamics_.model();
  MinvC_ = CholeskyFactor(model.M).solve(model.C);
}

void Variation::set(Instant t, const Eigen::Ref<const Eigen::MatrixXd>& q,
                    const Eigen::Ref<const Eigen::MatrixXd>& u) {
  before_ = master_.motion();
  t_ = t;
  q_ = q;
  u_ = u;
  enter();
}

// Projects the differences to the master's present flow: the locked contacts restrict them.
void Variation::enter() {
  const Motion& motion = master_.motion();
  const Flow& flow = *motion.flow;
  const ContactSet locked = flow.locked();
  const auto held = motion.held.head(std::popcount(locked));
  if ((master_.closed() & ~locked) != 0 || (held.array() != 0.0).any()) {
    throw SimulationError("t = " + std::to_string(t_.hi) +
                          ": a contact is inside its support, where it began; nothing is known of "
                          "motions close by");
  }
  const Eigen::Index modes = flow.modes();
  flow.enter_differences(q_, u_, z_.topRows(modes), v_.topRows(modes));
  if (locked != 0) flow.state_differences(z_.topRows(modes), v_.topRows(modes), q_, u_);
}

void Variation::scale(double factor) {
  q_ *= factor;
  u_ *= factor;
  z_ *= factor;
  v_ *= factor;
}

// Moves the differences to t on the flow before the present event.
void Variation::move(Instant t) {
  const Flow& flow = *before_.flow;
  const double tau = t - t_;
  t_ = t;
  if (!(tau > 0.0)) return;
  const Eigen::Index modes = flow.modes();
  for (Eigen::Index i = 0; i < modes; ++i) {
    const OscillatorKernel k = flow.oscillators().kernel(flow.frequencies() + i, tau);
    for (Eigen::Index j = 0; j < z_.cols(); ++j) {
      const double z = k.zz * z_(i, j) + k.zv * v_(i, j);
      v_(i, j) = k.vz * z_(i, j) + k.vv * v_(i, j);
      z_(i, j) = z;
    }
  }
  flow.state_differences(z_.topRows(modes), v_.topRows(modes), q_, u_);
}

void Variation::advance(Instant t, std::vector<ContactEvent>& events) {
  std::size_t known = events.size();
  while (master_.advance_once(t, events)) {
    move(master_.motion().t);
    jump(std::span(events).subspan(known));
    enter();
    before_ = master_.motion();
    known = events.size();
  }
  move(t);
}

// The active branch of the impact law at gamma-.
void Variation::find_impulses(ContactSet closing, ContactSet participants) {
  const Model& model = dynamics_.model();
  const Motion& after = master_.motion();
  G_ = of_contacts(dynamics_.G(), participants);
  const Eigen::Index n = G_.rows();
  gamma_.resize(n);
  gamma_rate_.resize(n);
  epsilon_.resize(n);
  slope_.resize(n);
  Eigen::Index row = 0;
  for_each(participants, [&](int i) {
    const bool held = contains(before_.flow->locked(), i);
    const Signal& velocity = before_.flow->gap_velocity(i);
    gamma_[row] = held ? 0.0 : value(velocity, before_);
    gamma_rate_[row] = held ? 0.0 : rate(velocity, before_);
    const bool stays = contains(closing & after.flow->locked(), i);
    const auto [epsilon, slope, none] =
        stays ? ImpactRestitution{} : restitution_at(contact_of(model, i), gamma_[row]);
    epsilon_[row] = epsilon;
    slope_[row++] = slope;
  });
  ContactVector gamma_C;
  if (model.law == ImpactLaw::newton) {
    const ContactVector b = gamma_ + epsilon_.cwiseProduct(gamma_);
    if (solve_lcp(G_, b, Lambda_, gamma_C) != Solved::yes) Lambda_.setZero(n);
    nu_.setZero(n);
    return;
  }
  ContactVector gamma_plus;
  if (solve_lcp(G_, gamma_, Lambda_, gamma_C) != Solved::yes) {
    Lambda_.setZero(n);
    gamma_C = gamma_;
  }
  const ContactVector b = gamma_C + G_ * epsilon_.cwiseProduct(Lambda_);
  if (solve_lcp(G_, b, nu_, gamma_plus) != Solved::yes) nu_.setZero(n);
}

// Lambda'(gamma-) d_gamma.
ContactVector Variation::derivative(const ContactVector& d_gamma) const {
  ContactVector d_Lambda, d_nu;
  if (dynamics_.model().law == ImpactLaw::newton) {
    const ContactVector change = epsilon_ - slope_.cwiseProduct(gamma_);
    const ContactVector b = d_gamma + change.cwiseProduct(d_gamma);
    solve_branch(G_, positive(Lambda_), b, d_Lambda);
    return d_Lambda;
  }
  solve_branch(G_, positive(Lambda_), d_gamma, d_Lambda);
  const ContactVector restored = d_Lambda + epsilon_.cwiseProduct(d_Lambda) -
                                 slope_.cwiseProduct(d_gamma).cwiseProduct(Lambda_);
  const ContactVector b = d_gamma + G_ * restored;
  solve_branch(G_, positive(nu_), b, d_nu);
  return restored + d_nu;
}

// Adds the acceleration by the contact forces.
void Variation::add_forces(const Motion& motion, double sign) {
  for_each(motion.flow->locked(), [&](int i) {
    acceleration_ += sign * value(motion.flow->force(i), motion) * dynamics_.MinvW().col(i);
  });
}

void Variation::jump(std::span<const ContactEvent> events) {
  ContactSet closing = 0;
  for (const ContactEvent& event : events) {
    if (event.kind != ContactEventKind::opens) closing |= bit(event.contact);
  }
  if (closing == 0) return;
  const Motion& after = master_.motion();
  const ContactSet locked = after.flow->locked();
  const ContactSet locked_before = before_.flow->locked();
  before_.flow->propagate(before_, after.t, before_);
  before_.flow->state(before_, position_, u_minus_);
  after.flow->state(after, position_, u_plus_);
  const ContactSet participants = closing | locked_before;
  find_impulses(closing, participants);

  // The time shift is that of the fastest closing contact. The end of a chatter has none of its
  // own.
  int first = -1;
  double fastest = 0.0;
  Eigen::Index row = 0;
  for_each(participants, [&](int i) {
    const double gamma = gamma_[row];
    const double rest = std::abs(gamma_rate_[row++]) * dynamics_.model().chatter_time;
    if (!contains(closing, i) || !(gamma < fastest)) return;
    if (contains(locked, i) && -gamma <= rest) return;
    first = i;
    fastest = gamma;
  });
  delays_.setZero();
  if (first >= 0) delays_ = dynamics_.W().col(first).transpose().lazyProduct(q_) / -fastest;

  du_ = u_minus_ - u_plus_;
  acceleration_.noalias() = MinvC_.lazyProduct(-du_);
  add_forces(before_, 1.0);
  add_forces(after, -1.0);
  ContactVector d_gamma(G_.rows());
  for (Eigen::Index k = 0; k < q_.cols(); ++k) {
    row = 0;
    for_each(participants, [&](int i) {
      d_gamma[row] = dynamics_.W().col(i).dot(u_.col(k)) + gamma_rate_[row] * delays_[k];
      ++row;
    });
    const ContactVector d_Lambda = derivative(d_gamma);
    q_.col(k) += delays_[k] * du_;
    u_.col(k) += delays_[k] * acceleration_;
    row = 0;
    for_each(participants, [&](int i) { u_.col(k) += d_Lambda[row++] * dynamics_.MinvW().col(i); });
  }
}

}  // namespace sprag
