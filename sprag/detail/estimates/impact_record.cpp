#include "sprag/detail/estimates/impact_record.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Gauss-Legendre quadrature on [0, 1]. turn_of_a_panel: phase of the fastest mode per panel [rad].
constexpr int nodes = 5;
constexpr double abscissa[nodes] = {0.046910077030668, 0.230765344947158, 0.5, 0.769234655052842,
                                    0.953089922969332};
constexpr double weight[nodes] = {0.118463442528095, 0.239314335249683, 0.284444444444444,
                                  0.239314335249683, 0.118463442528095};
constexpr double turn_of_a_panel = 0.5;
constexpr double most_panels = 4096.0;
constexpr int landing_steps = 8;

Uncertain add_noise(const Uncertain& x, double sigma) {
  return {x.value, std::hypot(x.sigma, sigma)};
}

}  // namespace

ImpactRecorder::ImpactRecorder(const Dynamics& dynamics, std::vector<ImpactRecord>& records,
                               double jitter, bool is_sure)
    : dynamics_(&dynamics),
      records_(&records),
      jitter_(jitter),
      is_sure_(is_sure),
      held_(static_cast<std::size_t>(dynamics.contacts())) {}

void ImpactRecorder::start() {
  for (Held& held : held_) held = {};
}

void ImpactRecorder::fly(const Motion& from, double tau) { fly(from, tau, false); }

void ImpactRecorder::fly(const Motion& from, double tau, const Eigen::MatrixXd& S_q,
                         const Eigen::MatrixXd& S_u, Eigen::Index columns) {
  const Flow& flow = *from.flow;
  if (flow.locked() == 0) return;
  const Eigen::Index n = flow.modes();
  Z_.resize(n, columns);
  V_.resize(n, columns);
  flow.enter_differences(S_q.leftCols(columns), S_u.leftCols(columns), Z_, V_);
  fly(from, tau, true);
}

// Sets row_z_ and row_v_: the force at tau as a linear function of z and z' at the start of the
// flight.
void ImpactRecorder::find_row(const Flow& flow, const Signal& force, double tau) {
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  if (kernels_.size() < flow.size()) kernels_.resize(flow.size());
  flow.oscillators().kernels(tau, nf, n, kernels_);
  const auto p = force.p.segment(nf, n);
  const auto r = force.r.segment(nf, n);
  row_z_ = p * kernels_.zz.segment(nf, n) + r * kernels_.vz.segment(nf, n);
  row_v_ = p * kernels_.zv.segment(nf, n) + r * kernels_.vv.segment(nf, n);
}

void ImpactRecorder::see(const Flow& flow, const Eigen::ArrayXd& row_z, const Eigen::ArrayXd& row_v,
                         Eigen::VectorXd& phi) const {
  const Eigen::Index n = flow.modes();
  phi = Z_.topRows(n).transpose() * row_z.matrix() + V_.topRows(n).transpose() * row_v.matrix();
}

// Fixes the deviations of the last flight: later measurements do not change them.
void ImpactRecorder::close(Held& held) const {
  const auto fix = [](Uncertain& x, Eigen::VectorXd& phi) {
    if (phi.size() > 0) x.sigma = phi.norm();
    phi.resize(0);
  };
  fix(held.begin, held.phi_begin);
  fix(held.end, held.phi_end);
  fix(held.largest, held.phi_largest);
  Uncertain last{held.last_impulse};
  fix(last, held.phi_impulse);
  held.impulse += held.last_impulse;
  if (held.any) held.deviation += last.sigma;
  held.last_impulse = 0.0;
}

void ImpactRecorder::fly(const Motion& from, double tau, bool known) {
  const Flow& flow = *from.flow;
  if (!(tau > 0.0)) return;
  const Eigen::Index n = flow.modes();
  const double fastest =
      n > 0 ? flow.oscillators().root_kappa().segment(flow.frequencies(), n).maxCoeff() : 0.0;
  const double panels =
      std::clamp(std::ceil(tau * std::max(fastest, 1.0 / tau) / turn_of_a_panel), 1.0, most_panels);
  for_each(flow.locked(), [&](int i) {
    Held& held = held_[static_cast<std::size_t>(i)];
    close(held);
    const Signal& force = flow.force(i);
    const auto at_age = [&](double age) {
      flow.propagate(from, from.t + age, there_);
      return value(force, there_);
    };
    const auto seen = [&](double age, Eigen::VectorXd& phi) {
      if (!known) return;
      find_row(flow, force, age);
      see(flow, row_z_, row_v_, phi);
    };
    Eigen::ArrayXd sum_z = Eigen::ArrayXd::Zero(n), sum_v = sum_z;
    if (!held.any) {
      held = {};
      held.any = true;
      held.begin.value = held.largest.value = at_age(0.0);
      seen(0.0, held.phi_begin);
      held.phi_largest = held.phi_begin;
    }
    double best = -1.0;
    double most = held.largest.value;
    const double step = tau / panels;
    for (double panel = 0.0; panel < panels; ++panel) {
      for (int k = 0; k < nodes; ++k) {
        const double age = (panel + abscissa[k]) * step;
        const double lambda = at_age(age);
        held.last_impulse += weight[k] * step * lambda;
        if (lambda > most) {
          most = lambda;
          best = age;
        }
        if (!known) continue;
        find_row(flow, force, age);
        sum_z += weight[k] * step * row_z_;
        sum_v += weight[k] * step * row_v_;
      }
    }
    if (known) see(flow, sum_z, sum_v, held.phi_impulse);
    held.end = {at_age(tau)};
    seen(tau, held.phi_end);
    if (held.end.value > most) {
      most = held.end.value;
      best = tau;
    }
    if (best < 0.0) return;
    for (int k = 0; k < landing_steps && best < tau; ++k) {
      (void)at_age(best);
      const double curvature = second_rate(force, there_);
      if (!(curvature < 0.0)) break;
      const double next = std::clamp(best - rate(force, there_) / curvature, 0.0, tau);
      const double lambda = at_age(next);
      if (!(lambda > most)) break;
      most = lambda;
      best = next;
    }
    held.largest = {most};
    seen(best, held.phi_largest);
  });
}

void ImpactRecorder::measured_release(int contact, const Eigen::Ref<const Eigen::VectorXd>& phi,
                                      double residual, double r) {
  Held& held = held_[static_cast<std::size_t>(contact)];
  const Eigen::Index c = held.phi_end.size();
  if (!held.any || c == 0 || c > phi.size()) return;
  // Later columns belong to process noise since then.
  const double alpha = phi.squaredNorm() + r;
  if (!(alpha > 0.0)) return;
  const double shrink = 1.0 / (alpha * (1.0 + std::sqrt(r / alpha)));
  const auto condition = [&](Eigen::VectorXd& of, double& mean) {
    if (of.size() != c) return;
    const double along = of.dot(phi.head(c));
    mean += along * residual / alpha;
    of -= along * shrink * phi.head(c);
  };
  condition(held.phi_begin, held.begin.value);
  condition(held.phi_end, held.end.value);
  condition(held.phi_largest, held.largest.value);
  condition(held.phi_impulse, held.last_impulse);
}

void ImpactRecorder::before(const Belief& belief) {
  u_before_ = belief.u;
  S_before_ = belief.S_u.leftCols(belief.columns);
}

void ImpactRecorder::before(const Eigen::VectorXd& u) {
  u_before_ = u;
  S_before_.resize(0, 0);
}

void ImpactRecorder::after(const Belief& belief, double rounding, double t, ContactSet struck,
                           std::span<const ContactEvent> events) {
  const Eigen::MatrixXd S = belief.S_u.leftCols(belief.columns);
  after(belief.u, &S, rounding, t, struck, events);
}

void ImpactRecorder::after(const Eigen::VectorXd& u, double t, ContactSet struck,
                           std::span<const ContactEvent> events) {
  after(u, nullptr, 0.0, t, struck, events);
}

void ImpactRecorder::after(const Eigen::VectorXd& u, const Eigen::MatrixXd* S, double rounding,
                           double t, ContactSet struck, std::span<const ContactEvent> events) {
  const Model& model = dynamics_->model();
  struck = independent_of(dynamics_->G(), 0, struck);
  const ContactMatrix G = of_contacts(dynamics_->G(), struck);
  ContactVector less(G.rows()), Lambda;
  const auto impulses = [&](const auto& from, const auto& to) {
    Eigen::Index row = 0;
    for_each(struck, [&](int i) { less[row++] = -dynamics_->W().col(i).dot(to - from); });
    if (arrest(G, less, Lambda) != Solved::yes) Lambda.setZero(G.rows());
  };
  impulses(u_before_, u);
  Eigen::VectorXd means = Lambda, variances = Eigen::VectorXd::Zero(G.rows());
  if (S != nullptr) {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(u.size());
    for (Eigen::Index j = 0; j < S->cols(); ++j) {
      if (j < S_before_.cols()) {
        impulses(S_before_.col(j), S->col(j));
      } else {
        impulses(none, S->col(j));
      }
      variances += Lambda.cwiseAbs2();
    }
  }
  const auto impulse_on = [&](int contact) -> Uncertain {
    Eigen::Index row = 0, found = -1;
    for_each(struck, [&](int i) {
      if (i == contact) found = row;
      ++row;
    });
    if (found < 0) return {0.0, S != nullptr ? 0.0 : infinity};
    if (S == nullptr) return {means[found]};
    return {means[found],
            std::hypot(std::sqrt(variances[found]), rounding / dynamics_->G()(contact, contact))};
  };
  ContactSet reported = 0;
  for (const ContactEvent& event : events) {
    const Contact& contact = model.contacts[static_cast<std::size_t>(event.contact)];
    const auto speed = [&](const Eigen::VectorXd& velocities,
                           const Eigen::MatrixXd* columns) -> Uncertain {
      const double gamma = gap_velocity(contact, velocities, t);
      if (columns == nullptr) return {gamma};
      return {gamma, std::hypot((contact.w.transpose() * *columns).norm(), rounding)};
    };
    ImpactRecord record;
    record.t = event.t;
    record.contact = event.contact;
    record.kind = event.kind;
    record.from_filter = S != nullptr;
    record.time = {event.t, jitter_};
    record.before = speed(u_before_, S != nullptr ? &S_before_ : nullptr);
    record.after = speed(u, S);
    record.impulse = impulse_on(event.contact);
    reported |= bit(event.contact);
    add(record);
  }
  for_each(struck & ~reported, [&](int i) { push(i, impulse_on(i)); });
}

void ImpactRecorder::add(ImpactRecord record) {
  Held& held = held_[static_cast<std::size_t>(record.contact)];
  if (record.kind == ContactEventKind::opens) {
    close(held);
    record.sustained = held.any;
    const double rounding = measurement_rounding * std::abs(held.largest.value);
    record.force_begin = add_noise(held.begin, rounding);
    record.force_end = add_noise(held.end, rounding);
    record.force_largest = add_noise(held.largest, rounding);
    record.force_impulse = add_noise({held.impulse, held.deviation},
                                     jitter_ * std::hypot(held.begin.value, held.end.value));
    held = {};
  } else {
    held = {};
  }
  if (!is_sure_) {
    for (Uncertain* x : {&record.before, &record.after, &record.impulse, &record.force_begin,
                         &record.force_end, &record.force_largest, &record.force_impulse}) {
      x->sigma = infinity;
    }
  }
  records_->push_back(record);
}

void ImpactRecorder::push(int contact, Uncertain impulse) {
  Held& held = held_[static_cast<std::size_t>(contact)];
  if (!held.any) return;
  held.impulse += impulse.value;
  held.deviation += impulse.sigma;
}

}  // namespace sprag
