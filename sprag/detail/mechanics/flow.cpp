#include "sprag/detail/mechanics/flow.h"

#include <array>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {

Signal Flow::signal(const Functional& functional) const {
  const Eigen::VectorXd& a = functional.a;
  const Eigen::VectorXd& b = functional.b;
  Signal s{Eigen::ArrayXd::Zero(size()), Eigen::ArrayXd::Zero(size()), 0.0, {}};
  s.constant = functional.constant + a.dot(q_forced_.constant) + b.dot(u_forced_.constant);
  s.held = Eigen::VectorXd::Zero(dynamics_->contacts());
  s.held.head(q_forced_.held.cols()) =
      q_forced_.held.transpose() * a + u_forced_.held.transpose() * b;
  const Eigen::VectorXd h_sin = functional.h.imag().cwiseQuotient(dynamics_->frequencies());
  s.p.head(nf_) = q_forced_.cos.transpose() * a + u_forced_.cos.transpose() * b;
  s.r.head(nf_) = q_forced_.sin.transpose() * a + u_forced_.sin.transpose() * b;
  s.p.head(nh_) += functional.h.real().array();
  s.r.head(nh_) += h_sin.array();
  for (Eigen::Index j = 0; 2 * j < functional.chain.size(); ++j) {
    s.p[nh_ + j] += functional.chain[2 * j];
    s.r[nh_ + j] += functional.chain[2 * j + 1];
  }
  if (path_ == FlowPath::diagonal) {
    s.p.segment(nf_, modes()) = a.array();
    s.r.segment(nf_, modes()) = b.array();
  } else {
    s.p.segment(nf_, modes()) = (Phi_.transpose() * a).array();
    s.r.segment(nf_, modes()) = (Phi_.transpose() * b).array();
  }
  if (path_ == FlowPath::dense) {
    const Eigen::ArrayXd psi_b = Psi_.transpose() * b;
    s.p.segment(nf_, modes()) -= oscillators_.kappa().segment(nf_, modes()) * psi_b;
    s.r.segment(nf_, modes()) -= 2.0 * oscillators_.delta().segment(nf_, modes()) * psi_b;
    s.r.segment(nf_, modes()) += (Psi_.transpose() * a).array();
  }
  return s;
}

void Flow::set_harmonics(Instant t, OscillatorState& x) const {
  const Eigen::VectorXd& Omega = dynamics_->frequencies();
  for (Eigen::Index j = 0; j < nh_; ++j) {
    // The phase Omega t in two parts: at t = 400 the rounded product alone has an error of 1e-13.
    const double phase = Omega[j] * t.hi;
    const double rest = std::fma(Omega[j], t.hi, -phase) + Omega[j] * t.lo;
    const double c = std::cos(phase);
    const double s = std::sin(phase);
    x.z[j] = c - rest * s;
    x.v[j] = -Omega[j] * (s + rest * c);
  }
}

void Flow::enter(const Eigen::Ref<const Eigen::VectorXd>& q,
                 const Eigen::Ref<const Eigen::VectorXd>& u, Instant t,
                 const Eigen::Ref<const Eigen::VectorXd>& held, Motion& motion) const {
  motion.flow = this;
  motion.t = t;
  motion.held.setZero(dynamics_->contacts());
  motion.held.head(held.size()) = held;
  motion.x.z.setZero(size());
  motion.x.v.setZero(size());
  set_phases(t, motion.x);
  const auto phases = motion.x.z.head(nf_).matrix();
  const auto phase_rates = motion.x.v.head(nf_).matrix();
  auto z = motion.x.z.segment(nf_, modes()).matrix();
  auto v = motion.x.v.segment(nf_, modes()).matrix();
  const auto subtract = [&](const Forced& forced, auto& y) {
    y -= forced.constant;
    y.noalias() -= forced.held * held;
    y.noalias() -= forced.cos * phases;
    y.noalias() -= forced.sin * phase_rates;
  };
  if (path_ == FlowPath::diagonal) {
    z = q;
    v = u;
  } else {
    z.noalias() = enter_zq_ * q;
    v.noalias() = enter_vu_ * u;
  }
  if (path_ == FlowPath::dense) {
    z.noalias() += enter_zu_ * u;
    v.noalias() += enter_vq_ * q;
  }
  subtract(z_forced_, z);
  subtract(v_forced_, v);
  motion.alpha = alpha0_;
  motion.alpha.matrix().noalias() += alpha_held_ * held;
}

void Flow::propagate(const Motion& from, Instant t, Motion& to) const {
  const double tau = t - from.t;
  if (&from != &to) to = from;
  move_modes(from, tau, nf_, modes(), to.x);
  to.t = t;
  set_phases(t, to.x);
}

void Flow::move_modes(const Motion& from, double tau, Eigen::Index first, Eigen::Index count,
                      OscillatorState& x) const {
  oscillators_.propagate(from.x, from.alpha, tau, first, count, x);
  if (!drives_.empty()) drives_.respond(oscillators_, from.x, tau, first, first + count, x);
}

void Flow::state(const Motion& motion, Eigen::Ref<Eigen::VectorXd> q,
                 Eigen::Ref<Eigen::VectorXd> u) const {
  const auto phases = motion.x.z.head(nf_).matrix();
  const auto phase_rates = motion.x.v.head(nf_).matrix();
  const auto z = motion.x.z.segment(nf_, modes()).matrix();
  const auto v = motion.x.v.segment(nf_, modes()).matrix();
  if (path_ == FlowPath::diagonal) {
    q = z;
    u = v;
  } else {
    q.noalias() = Phi_ * z;
    u.noalias() = Phi_ * v;
  }
  if (path_ == FlowPath::dense) {
    q.noalias() += Psi_ * v;
    // Column by column: a product with an expression would allocate it.
    for (Eigen::Index i = 0; i < modes(); ++i) {
      const double fall =
          oscillators_.kappa()[nf_ + i] * z[i] + 2.0 * oscillators_.delta()[nf_ + i] * v[i];
      u -= fall * Psi_.col(i);
    }
  }
  const auto add = [&](const Forced& forced, auto& x) {
    x += forced.constant;
    x.noalias() += forced.held * motion.held.head(forced.held.cols());
    x.noalias() += forced.cos * phases;
    x.noalias() += forced.sin * phase_rates;
  };
  add(q_forced_, q);
  add(u_forced_, u);
}

// multiply() and not Eigen's blocked products, which allocate.
void Flow::enter_differences(const Eigen::Ref<const Eigen::MatrixXd>& q,
                             const Eigen::Ref<const Eigen::MatrixXd>& u,
                             Eigen::Ref<Eigen::MatrixXd> z, Eigen::Ref<Eigen::MatrixXd> v) const {
  if (path_ == FlowPath::diagonal) {
    z = q;
    v = u;
    return;
  }
  multiply(enter_zq_, q, z);
  multiply(enter_vu_, u, v);
  if (path_ == FlowPath::dense) {
    multiply_and_add(enter_zu_, u, z);
    multiply_and_add(enter_vq_, q, v);
  }
}

void Flow::state_differences(const Eigen::Ref<const Eigen::MatrixXd>& z,
                             const Eigen::Ref<const Eigen::MatrixXd>& v,
                             Eigen::Ref<Eigen::MatrixXd> q, Eigen::Ref<Eigen::MatrixXd> u) const {
  if (path_ == FlowPath::diagonal) {
    q = z;
    u = v;
    return;
  }
  multiply(Phi_, z, q);
  multiply(Phi_, v, u);
  if (path_ != FlowPath::dense) return;
  multiply_and_add(Psi_, v, q);
  for (Eigen::Index i = 0; i < modes(); ++i) {
    const double kappa = oscillators_.kappa()[nf_ + i];
    const double delta = oscillators_.delta()[nf_ + i];
    for (Eigen::Index k = 0; k < z.cols(); ++k) {
      u.col(k) -= (kappa * z(i, k) + 2.0 * delta * v(i, k)) * Psi_.col(i);
    }
  }
}

void Flow::close_gaps(ContactSet contacts, Instant t, Eigen::VectorXd& q) const {
  Eigen::Index k = 0;
  for_each(locked_, [&](int i) {
    const auto shape = static_shapes_.col(k++);
    if (!contains(contacts, i)) return;
    const Contact& contact = dynamics_->model().contacts[static_cast<std::size_t>(i)];
    q -= sprag::gap(contact, q, t.hi) * shape;
  });
}

void Flow::enter_closed(Eigen::VectorXd& q, const Eigen::Ref<const Eigen::VectorXd>& u, Instant t,
                        Motion& motion) const {
  static constexpr std::array<double, max_contacts> no_gaps{};
  close_gaps(locked_, t, q);
  enter(q, u, t, Eigen::VectorXd::Map(no_gaps.data(), std::popcount(locked_)), motion);
}

void Flow::close_gap_differences(Eigen::Ref<Eigen::MatrixXd> q) const {
  Eigen::Index k = 0;
  for_each(locked_, [&](int i) {
    for (auto column : q.colwise()) {
      column -= dynamics_->W().col(i).dot(column) * static_shapes_.col(k);
    }
    ++k;
  });
}

void Flow::kick(int contact, double Lambda, Motion& motion) const {
  motion.x.v.segment(nf_, modes()) += Lambda * kick_.col(contact).array();
}

namespace {

// Contribution of the sampled inputs to the first and second rate of a signal, beyond that of
// undriven oscillators: the inputs' own derivatives, and the forces on the responses.
struct SampledRates {
  double first = 0.0, second = 0.0;
};

SampledRates sampled_rates(const Signal& signal, const Motion& motion) {
  SampledRates sum;
  const SampledResponse& sampled = *motion.flow->sampled();
  const OscillatorState& x = motion.x;
  for (Eigen::Index c = 0; c < sampled.inputs().channels(); ++c) {
    for (Eigen::Index j = 0; j + 1 < chain_entries; ++j) {
      const Eigen::Index k = sampled.first() + chain_entries * c + j;
      sum.first += signal.r[k] * x.z[k + 1];
      sum.second += signal.p[k] * x.z[k + 1] + signal.r[k] * x.v[k + 1];
    }
  }
  const Oscillators& o = motion.flow->oscillators();
  for (Eigen::Index i = 0; i < sampled.modes(); ++i) {
    const Eigen::Index k = sampled.first_mode() + i;
    if (signal.p[k] == 0.0 && signal.r[k] == 0.0) continue;
    const PolynomialForce F = sampled.force(i, x);
    sum.first += signal.r[k] * F[0];
    sum.second += (signal.p[k] - 2.0 * o.delta()[k] * signal.r[k]) * F[0] + signal.r[k] * F[1];
  }
  return sum;
}

}  // namespace

double value(const Signal& signal, const Motion& motion) {
  return signal.constant + signal.held.dot(motion.held) + (signal.p * motion.x.z).sum() +
         (signal.r * motion.x.v).sum();
}

double rate(const Signal& signal, const Motion& motion) {
  const Oscillators& o = motion.flow->oscillators();
  double sum = (signal.p * motion.x.v +
                signal.r * (motion.alpha - 2.0 * o.delta() * motion.x.v - o.kappa() * motion.x.z))
                   .sum();
  for (const Drive& drive : motion.flow->drives().all()) {
    sum += signal.r[drive.mode] * drive.force(motion.x);
  }
  if (motion.flow->sampled() != nullptr) sum += sampled_rates(signal, motion).first;
  return sum;
}

double second_rate(const Signal& signal, const Motion& motion) {
  const Oscillators& o = motion.flow->oscillators();
  const auto acceleration = motion.alpha - 2.0 * o.delta() * motion.x.v - o.kappa() * motion.x.z;
  double sum = (signal.p * acceleration -
                signal.r * (2.0 * o.delta() * acceleration + o.kappa() * motion.x.v))
                   .sum();
  for (const Drive& drive : motion.flow->drives().all()) {
    const double p = signal.p[drive.mode];
    const double r = signal.r[drive.mode];
    sum += (p - 2.0 * o.delta()[drive.mode] * r) * drive.force(motion.x) +
           r * drive.force_rate(o, motion.x);
  }
  if (motion.flow->sampled() != nullptr) sum += sampled_rates(signal, motion).second;
  return sum;
}

double largest_terms(const Signal& signal, const Motion& motion) {
  return std::abs(signal.constant) + (signal.p * motion.x.z).abs().sum() +
         (signal.r * motion.x.v).abs().sum();
}

}  // namespace sprag
