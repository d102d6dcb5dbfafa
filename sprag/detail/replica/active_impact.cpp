#include "sprag/detail/replica/active_impact.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace sprag {
namespace {

// Impulses that differ by a larger share count as another impact.
constexpr double same_impact = 1e-9;
// A contact that leaves with a smaller share of the incoming velocity stays.
constexpr double hardly_thrown = 1e-12;

}  // namespace

SingleImpact single_impact(const Eigen::MatrixXd& G_all, ImpactLaw law,
                           const Eigen::VectorXd& restitution, int contact, double epsilon,
                           ContactSet held) {
  const ContactSet closed = held | bit(contact);
  const ContactMatrix G = of_contacts(G_all, closed);
  ContactVector all_epsilon(G.rows()), gamma(G.rows()), gamma_plus;
  Eigen::Index row = 0, of_contact = 0;
  for_each(closed, [&](int j) {
    if (j == contact) of_contact = row;
    gamma[row] = j == contact ? -1.0 : 0.0;
    all_epsilon[row++] = j == contact ? epsilon : restitution[j];
  });
  SingleImpact of;
  of.solved = impact(law, G, all_epsilon, gamma, of.Lambda, gamma_plus);
  if (of.solved != Solved::yes) return of;
  of.change = 1.0 + gamma_plus[of_contact];
  of.Lambda /= of.change;
  row = 0;
  for_each(closed, [&](int j) {
    const double leaves = gamma_plus[row++] * std::sqrt(G_all(contact, contact));
    const bool stays = leaves <= hardly_thrown * std::sqrt(G_all(j, j));
    if (j != contact && stays) of.staying |= bit(j);
  });
  return of;
}

ActiveImpact::ActiveImpact(const Dynamics& dynamics) : dynamics_(&dynamics) {
  directions_.setZero(dynamics.coordinates(), dynamics.contacts());
}

void ActiveImpact::set(const std::vector<Closing>& closings, ContactSet staying,
                       ContactSet leaving) {
  closings_ = &closings;
  staying_ = staying;
  leaving_ = leaving;
  const Eigen::Index n = size();
  gamma_.resize(n);
  const ContactMatrix G_staying = of_contacts(dynamics_->G(), staying);
  ContactVector pushed, held;
  for (Eigen::Index k = 0; k < n; ++k) {
    const int i = closing(k).contact;
    auto direction = directions_.col(k);
    direction = dynamics_->MinvW().col(i);
    if (staying == 0) continue;
    pushed.resize(std::popcount(staying));
    Eigen::Index row = 0;
    for_each(staying, [&](int j) { pushed[row++] = dynamics_->G()(j, i); });
    if (arrest(G_staying, pushed, held) != Solved::yes) continue;
    row = 0;
    for_each(staying, [&](int j) { direction += held[row++] * dynamics_->MinvW().col(j); });
  }
  G_.resize(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto w = dynamics_->W().col(closing(k).contact);
    for (Eigen::Index l = 0; l < n; ++l) G_(k, l) = w.dot(directions_.col(l));
  }
  for (Eigen::Index k = 0; k < n; ++k) gamma_[k] = closing(k).gamma;
  if (arrest(G_, gamma_, compression_) != Solved::yes) compression_.setZero(n);
}

// Computes Lambda_ from gamma_.
bool ActiveImpact::find_impulses(bool of_change) {
  const bool newton = dynamics_->model().law == ImpactLaw::newton;
  if (newton) {
    for (Eigen::Index k = 0; k < size(); ++k) {
      const auto& [epsilon, slope, scatter] = closing(k).restitution;
      gamma_[k] *= 1.0 + (of_change ? epsilon - slope * closing(k).gamma : epsilon);
    }
  }
  if (arrest(G_, gamma_, Lambda_) != Solved::yes) return false;
  if (newton) return true;
  for (Eigen::Index k = 0; k < size(); ++k) {
    const auto& [epsilon, slope, scatter] = closing(k).restitution;
    Lambda_[k] *= 1.0 + epsilon;
    if (of_change) Lambda_[k] -= slope * gamma_[k] * compression_[k];
  }
  return true;
}

ActiveImpact::Decision ActiveImpact::decide(const Eigen::VectorXd& before,
                                            const Eigen::VectorXd& after, double t,
                                            Eigen::VectorXd& difference) const {
  if (size() == 1 && staying_ == 0 && leaving_ == 0) return Decision::same;
  const Model& model = dynamics_->model();
  ContactSet hit = 0;
  for (const Closing& of : *closings_) hit |= bit(of.contact);
  const ContactSet closed = hit | staying_ | leaving_;
  const ContactMatrix G = of_contacts(dynamics_->G(), closed);
  ContactVector gamma(G.rows()), epsilon(G.rows()), Lambda, gamma_plus;
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    const Contact& contact = model.contacts[static_cast<std::size_t>(i)];
    const auto found = std::find_if(closings_->begin(), closings_->end(),
                                    [i](const Closing& of) { return of.contact == i; });
    const bool closes = found != closings_->end();
    gamma[row] = closes ? gap_velocity(contact, before, t) : 0.0;
    epsilon[row++] = closes ? found->restitution.epsilon : contact.restitution;
  });
  if (impact(model.law, G, epsilon, gamma, Lambda, gamma_plus) != Solved::yes) {
    return Decision::same;
  }
  difference = before - after;
  bool as_reported = true;
  row = 0;
  for_each(closed, [&](int i) {
    difference += Lambda[row] * dynamics_->MinvW().col(i);
    if (contains(hit, i) && !(Lambda[row] > 0.0)) as_reported = false;
    if (contains(staying_, i) && gamma_plus[row] > 0.0) as_reported = false;
    ++row;
  });
  if (!(difference.norm() > same_impact * (after - before).norm())) return Decision::same;
  return as_reported ? Decision::as_reported : Decision::other;
}

}  // namespace sprag
