#include "studies/convergence/moreau_replica.h"

#include <array>
#include <bit>
#include <utility>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr double theta = 0.5;

}  // namespace

MoreauReplica::MoreauReplica(Model model, double h) : dynamics_(std::move(model)), h_(h) {
  const Model& m = dynamics_.model();
  const Eigen::MatrixXd M_hat = m.M + h * theta * m.C + h * h * theta * theta * m.K;
  if (dynamics_.diagonal()) {
    mass_hat_ = M_hat.diagonal();
    minv_hat_W_ = mass_hat_.cwiseInverse().asDiagonal() * dynamics_.W();
  } else {
    const CholeskyFactor factor(M_hat);
    if (!factor.exists()) throw ModelError("M must be positive definite");
    inverse_hat_ = factor.solve(Eigen::MatrixXd::Identity(M_hat.rows(), M_hat.cols()));
    minv_hat_W_ = factor.solve(dynamics_.W());
  }
  G_hat_ = product(dynamics_.W().transpose(), minv_hat_W_);
  force_.setZero(dynamics_.coordinates());
  u_new_.setZero(dynamics_.coordinates());
  product_.setZero(dynamics_.coordinates());
}

void MoreauReplica::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                          MoreauState& state) {
  state.tick = k;
  state.chi = chi;
  state.q = start.q;
  state.u = start.u;
  state.refused_impacts = 0;
}

void MoreauReplica::add_force(double t, double weight) {
  force_ += weight * dynamics_.force_constant();
  const Eigen::VectorXd& Omega = dynamics_.frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    force_ += weight * (std::cos(Omega[j] * t) * dynamics_.force_amplitudes().col(j).real() -
                        std::sin(Omega[j] * t) * dynamics_.force_amplitudes().col(j).imag());
  }
  dynamics_.inputs().add_force(t, weight, force_);
}

void MoreauReplica::tick(std::span<const ContactEvent> events, MoreauState& state) {
  const Model& model = dynamics_.model();
  const double t = tick_instant(state.tick, h_).hi;
  const double t_new = tick_instant(state.tick + 1, h_).hi;
  ++state.tick;

  // M_hat u_new = M u + h f_theta - h (1 - theta) C u - h K (q + h theta (1 - theta) u)
  force_.setZero();
  add_force(t, 1.0 - theta);
  add_force(t_new, theta);
  const bool diagonal = dynamics_.diagonal();
  product_ = state.q + h_ * theta * (1.0 - theta) * state.u;
  if (diagonal) {
    u_new_ = (model.M.diagonal().cwiseProduct(state.u) + h_ * force_ -
              h_ * (1.0 - theta) * model.C.diagonal().cwiseProduct(state.u) -
              h_ * model.K.diagonal().cwiseProduct(product_))
                 .cwiseQuotient(mass_hat_);
  } else {
    force_ *= h_;
    force_.noalias() += model.M * state.u;
    force_.noalias() -= (h_ * (1.0 - theta)) * (model.C * state.u);
    force_.noalias() -= h_ * (model.K * product_);
    u_new_.noalias() = inverse_hat_ * force_;
  }

  ContactSet closing = 0;
  ContactSet pulsing = 0;
  for (const ContactEvent& event : events) {
    state.chi = after(state.chi, event);
    if (event.kind == ContactEventKind::opens) continue;
    closing |= bit(event.contact);
    if (event.kind == ContactEventKind::pulse) pulsing |= bit(event.contact);
  }
  const ContactSet active = state.chi | closing;
  if (active != 0) {
    const auto n = static_cast<Eigen::Index>(std::popcount(active));
    ContactVector epsilon(n);
    ContactVector gamma(n);
    Eigen::Index row = 0;
    for_each(active, [&](int i) {
      const Contact& contact = model.contacts[index(i)];
      gamma[row] = gap_velocity(contact, u_new_, t_new);
      const bool impacts = closing != 0 && (contains(pulsing, i) || !contains(closing, i));
      epsilon[row] = impacts ? restitution_of_replica(contact) : 0.0;
      ++row;
    });
    ContactVector P;
    ContactVector gamma_plus;
    ContactSet unsatisfied = 0;
    if (semidefinite_impact(model.law, of_contacts(G_hat_, active), epsilon, gamma, 0.0 * gamma, P,
                            gamma_plus, unsatisfied) == Solved::yes) {
      row = 0;
      for_each(active, [&](int i) { u_new_ += P[row++] * minv_hat_W_.col(i); });
    } else {
      ++state.refused_impacts;
    }
  }
  state.q += h_ * (theta * u_new_ + (1.0 - theta) * state.u);
  state.u = u_new_;
}

void MoreauReplica::apply(std::span<const ContactEvent> events, MoreauState& state) {
  for (const ContactEvent& event : events) state.chi = after(state.chi, event);
}

void MoreauReplica::output(const MoreauState& state, Eigen::Ref<Eigen::VectorXd> q,
                           Eigen::Ref<Eigen::VectorXd> u) const {
  q = state.q;
  u = state.u;
}

void MoreauReplica::note(const MoreauState& state, Confidence& confidence) const {
  confidence.refused_impacts = state.refused_impacts;
}

}  // namespace sprag
