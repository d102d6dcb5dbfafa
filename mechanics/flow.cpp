#include "mechanics/flow.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <complex>

#include "mechanics/modal_analysis.h"

namespace sprag {
namespace {

using namespace modal;

std::vector<int> members(ContactSet set) {
  std::vector<int> list;
  for (int i = 0; i < max_contacts; ++i) {
    if (contains(set, i)) list.push_back(i);
  }
  return list;
}

// Locked contacts take modes away; the bank keeps its size with oscillators at rest in their place.
Eigen::ArrayXd behind_frequencies(const Eigen::VectorXd& front, const VectorR& modes,
                                  Eigen::Index coordinates) {
  Eigen::ArrayXd all = Eigen::ArrayXd::Zero(front.size() + coordinates);
  all.head(front.size()) = front.array();
  all.segment(front.size(), modes.size()) = modes.cast<double>().array();
  return all;
}

}  // namespace

Flow::Flow(const Dynamics& dynamics, ContactSet locked)
    : dynamics_(&dynamics),
      locked_(locked),
      nf_(dynamics.frequencies().size()),
      locked_contacts_(members(locked)) {
  modes_ = dynamics.coordinates() - static_cast<Eigen::Index>(locked_contacts_.size());
  if (locked == 0 && dynamics.diagonal()) {
    build_diagonal();
  } else {
    build_on_nullspace();
  }
  build_signals();
}

// Columns cos and sin of Re(A_j e^(i Omega_j t)) = Re A_j z_f + Im A_j / Omega_j z_f'.
void Flow::set_harmonics(const Eigen::MatrixXcd& A, Forced& forced) const {
  forced.cos = A.real();
  forced.sin = A.imag() * dynamics_->frequencies().cwiseInverse().asDiagonal();
}

Flow::Forced Flow::rate(const Forced& forced) const {
  return {Eigen::VectorXd::Zero(forced.constant.size()),
          Eigen::MatrixXd::Zero(forced.held.rows(), forced.held.cols()),
          -forced.sin * dynamics_->frequencies().cwiseAbs2().asDiagonal(), forced.cos};
}

void Flow::build_diagonal() {
  path_ = FlowPath::diagonal;
  const Model& model = dynamics_->model();
  const Eigen::Index f = model.coordinates();
  const Eigen::VectorXd mass = model.M.diagonal();
  const VectorR delta = (model.C.diagonal().array() / mass.array() / 2.0).matrix().cast<Real>();
  const VectorR kappa = (model.K.diagonal().array() / mass.array()).matrix().cast<Real>();
  const Eigen::VectorXd& Omega = dynamics_->frequencies();

  Eigen::MatrixXcd A(f, nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const Eigen::VectorXcd forcing =
        dynamics_->force_amplitudes().col(j).cwiseQuotient(mass.cast<std::complex<double>>());
    A.col(j) = response(delta, kappa, forcing.cast<std::complex<Real>>(), Omega[j])
                   .cast<std::complex<double>>();
  }
  const Eigen::ArrayXd push = dynamics_->force_constant().array() / mass.array();
  const Eigen::ArrayXd k = kappa.cast<double>().array();
  q_forced_.constant = (k > 0.0).select(push / k, 0.0).matrix();
  q_forced_.held.resize(f, 0);
  set_harmonics(A, q_forced_);
  z_forced_ = q_forced_;
  v_forced_ = rate(z_forced_);

  oscillators_ = Oscillators(behind_frequencies(Eigen::VectorXd::Zero(nf_), delta, f),
                             behind_frequencies(Omega.cwiseAbs2(), kappa, f));
  alpha0_ = Eigen::ArrayXd::Zero(size());
  alpha0_.segment(nf_, f) = (k > 0.0).select(0.0, push);
  alpha_held_ = Eigen::MatrixXd::Zero(size(), 0);
  kick_ = dynamics_->MinvW();
}

void Flow::build_on_nullspace() {
  const Model& model = dynamics_->model();
  const Eigen::Index f = model.coordinates();
  const auto l = static_cast<Eigen::Index>(locked_contacts_.size());
  const MatrixR M = model.M.cast<Real>();
  const MatrixR C = model.C.cast<Real>();
  const MatrixR K = model.K.cast<Real>();
  MatrixR W(f, l);
  VectorR offsets(l);
  MatrixCR motion(l, nf_);
  for (Eigen::Index i = 0; i < l; ++i) {
    const int contact = locked_contacts_[static_cast<std::size_t>(i)];
    W.col(i) = dynamics_->W().col(contact).cast<Real>();
    offsets[i] = dynamics_->offsets()[contact];
    motion.row(i) = dynamics_->motion_amplitudes().row(contact).cast<std::complex<Real>>();
  }

  MatrixR B = constrained_basis(M, W, locked_contacts_);
  const Eigen::Index r = B.cols();
  MatrixR V;
  const bool modal = diagonalize(B.transpose() * K * B, B.transpose() * C * B, V);
  path_ = modal ? FlowPath::modal : FlowPath::dense;
  if (modal) B = B * V;
  const MatrixR K_hat = B.transpose() * K * B;
  const MatrixR C_hat = B.transpose() * C * B;

  // The locked contacts carry q_D = D (g_L - c_L - s_L(t)) along, M-orthogonal to null(W_L^T).
  const MatrixR MinvW = M.llt().solve(W);
  const MatrixR D =
      l > 0 ? MatrixR(MinvW * (W.transpose() * MinvW).inverse()) : MatrixR::Zero(f, 0);
  const MatrixCR Dc = D.cast<std::complex<Real>>();
  const VectorR push = B.transpose() * (dynamics_->force_constant().cast<Real>() + K * D * offsets);
  const MatrixR push_held = -B.transpose() * K * D;
  MatrixCR forcing(r, nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const std::complex<Real> i_Omega(0, dynamics_->frequencies()[j]);
    const MatrixCR Z = K.cast<std::complex<Real>>() + i_Omega * C.cast<std::complex<Real>>();
    const VectorCR F = dynamics_->force_amplitudes().col(j).cast<std::complex<Real>>();
    forcing.col(j) = B.transpose().cast<std::complex<Real>>() * (F + Z * (Dc * motion.col(j)));
  }

  VectorR delta(r);
  VectorR kappa(r);
  VectorR y0 = VectorR::Zero(r);
  MatrixR y_held = MatrixR::Zero(r, l);
  MatrixCR Y(r, nf_);
  VectorR alpha0 = VectorR::Zero(r);
  MatrixR alpha_held = MatrixR::Zero(r, l);
  MatrixR P = MatrixR::Identity(r, r);
  MatrixR R = MatrixR::Zero(r, r);
  if (modal) {
    delta = C_hat.diagonal().cwiseMax(Real(0)) / 2;
    kappa = K_hat.diagonal();
    drop_noise(kappa);
    for (Eigen::Index i = 0; i < r; ++i) {
      if (kappa[i] > 0) {
        y0[i] = push[i] / kappa[i];
        y_held.row(i) = push_held.row(i) / kappa[i];
      } else {
        alpha0[i] = push[i];
        alpha_held.row(i) = push_held.row(i);
      }
    }
    for (Eigen::Index j = 0; j < nf_; ++j) {
      Y.col(j) = response(delta, kappa, forcing.col(j), dynamics_->frequencies()[j]);
    }
  } else {
    const ComplexModes modes = complex_modes(K_hat, C_hat);
    delta = modes.delta;
    kappa = modes.kappa;
    P = modes.P;
    R = modes.R;
    const Eigen::LDLT<MatrixR> static_stiffness(K_hat);
    y0 = static_stiffness.solve(push);
    y_held = static_stiffness.solve(push_held);
    const MatrixR residual = K_hat * y0 - push;
    const MatrixR residual_held = K_hat * y_held - push_held;
    if (!(residual.norm() <= 1e-9L * (1 + push.norm())) ||
        !(residual_held.norm() <= 1e-9L * (1 + push_held.norm()))) {
      throw ModelError(
          "a constant force acts on a motion without stiffness while C couples the "
          "modes: this has no steady solution");
    }
    for (Eigen::Index j = 0; j < nf_; ++j) {
      const Real Omega = dynamics_->frequencies()[j];
      MatrixCR Z = K_hat.cast<std::complex<Real>>() +
                   std::complex<Real>(0, Omega) * C_hat.cast<std::complex<Real>>();
      Z.diagonal().array() -= Omega * Omega;
      Y.col(j) = Z.fullPivLu().solve(forcing.col(j));
    }
  }

  const Forced y_forced = [&] {
    Forced y{y0.cast<double>(), y_held.cast<double>(), {}, {}};
    set_harmonics(Y.cast<std::complex<double>>(), y);
    return y;
  }();
  q_forced_.constant = (B * y0 - D * offsets).cast<double>();
  q_forced_.held = (B * y_held + D).cast<double>();
  set_harmonics((B.cast<std::complex<Real>>() * Y - Dc * motion).cast<std::complex<double>>(),
                q_forced_);

  const MatrixR to_y = B.transpose() * M;
  if (modal) {
    Phi_ = B.cast<double>();
    enter_zq_ = to_y.cast<double>();
    enter_vu_ = enter_zq_;
    z_forced_ = y_forced;
    v_forced_ = rate(y_forced);
    kick_ = enter_zq_ * dynamics_->MinvW();
  } else {
    // [y; y'] = T [z; z'], z'' = -kappa z - 2 delta z'.
    MatrixR T(2 * r, 2 * r);
    T << P, R, -R * kappa.asDiagonal(), P - 2 * R * delta.asDiagonal();
    const Eigen::FullPivLU<MatrixR> lu(T);
    if (!lu.isInvertible() || lu.rcond() < 1e-14L) {
      throw ModelError("M, C and K have a defective mode; change the damping a little");
    }
    const MatrixR T_inverse = lu.inverse();
    Phi_ = (B * P).cast<double>();
    Psi_ = (B * R).cast<double>();
    const MatrixR zy = T_inverse.topLeftCorner(r, r);
    const MatrixR zv = T_inverse.topRightCorner(r, r);
    const MatrixR vy = T_inverse.bottomLeftCorner(r, r);
    const MatrixR vv = T_inverse.bottomRightCorner(r, r);
    enter_zq_ = (zy * to_y).cast<double>();
    enter_zu_ = (zv * to_y).cast<double>();
    enter_vq_ = (vy * to_y).cast<double>();
    enter_vu_ = (vv * to_y).cast<double>();
    const Forced y_rate = rate(y_forced);
    const auto combine = [&](const MatrixR& of_y, const MatrixR& of_rate) {
      const Eigen::MatrixXd a = of_y.cast<double>();
      const Eigen::MatrixXd b = of_rate.cast<double>();
      return Forced{a * y_forced.constant + b * y_rate.constant,
                    a * y_forced.held + b * y_rate.held, a * y_forced.cos + b * y_rate.cos,
                    a * y_forced.sin + b * y_rate.sin};
    };
    z_forced_ = combine(zy, zv);
    v_forced_ = combine(vy, vv);
  }

  oscillators_ = Oscillators(behind_frequencies(Eigen::VectorXd::Zero(nf_), delta, f),
                             behind_frequencies(dynamics_->frequencies().cwiseAbs2(), kappa, f));
  alpha0_ = behind_frequencies(Eigen::VectorXd::Zero(nf_), alpha0, f);
  alpha_held_ = Eigen::MatrixXd::Zero(size(), l);
  alpha_held_.middleRows(nf_, r) = alpha_held.cast<double>();
}

void Flow::build_signals() {
  const int m = dynamics_->contacts();
  const auto l = static_cast<Eigen::Index>(locked_contacts_.size());
  const auto count = static_cast<std::size_t>(m);
  gap_.resize(count);
  gap_velocity_.resize(count);
  force_.resize(count);
  for (int i = 0; i < m; ++i) {
    if (contains(locked_, i)) continue;
    gap_[static_cast<std::size_t>(i)] = signal(dynamics_->gap(i));
    gap_velocity_[static_cast<std::size_t>(i)] = signal(dynamics_->gap_velocity(i));
  }

  // lambda_L = -G_L^-1 (gamma_L' without contact forces).
  Eigen::MatrixXd G(l, l);
  for (Eigen::Index i = 0; i < l; ++i) {
    for (Eigen::Index j = 0; j < l; ++j) {
      G(i, j) = dynamics_->G()(locked_contacts_[static_cast<std::size_t>(i)],
                               locked_contacts_[static_cast<std::size_t>(j)]);
    }
  }
  const Eigen::MatrixXd G_inverse = l > 0 ? Eigen::MatrixXd(G.inverse()) : G;
  for (Eigen::Index i = 0; i < l; ++i) {
    Functional lambda{Eigen::VectorXd::Zero(dynamics_->coordinates()),
                      Eigen::VectorXd::Zero(dynamics_->coordinates()), 0.0,
                      Eigen::VectorXcd::Zero(nf_)};
    for (Eigen::Index j = 0; j < l; ++j) {
      const Functional a =
          dynamics_->free_acceleration(locked_contacts_[static_cast<std::size_t>(j)]);
      lambda.a -= G_inverse(i, j) * a.a;
      lambda.b -= G_inverse(i, j) * a.b;
      lambda.constant -= G_inverse(i, j) * a.constant;
      lambda.h -= G_inverse(i, j) * a.h;
    }
    force_[static_cast<std::size_t>(locked_contacts_[static_cast<std::size_t>(i)])] =
        signal(lambda);
  }
}

Signal Flow::signal(const Functional& functional) const {
  const Forced u_forced = rate(q_forced_);
  const Eigen::VectorXd& a = functional.a;
  const Eigen::VectorXd& b = functional.b;
  Signal s{Eigen::ArrayXd::Zero(size()), Eigen::ArrayXd::Zero(size()), 0.0, {}};
  s.constant = functional.constant + a.dot(q_forced_.constant);
  s.held = Eigen::VectorXd::Zero(dynamics_->contacts());
  s.held.head(q_forced_.held.cols()) = q_forced_.held.transpose() * a;
  const Eigen::VectorXd h_sin = functional.h.imag().cwiseQuotient(dynamics_->frequencies());
  s.p.head(nf_) =
      q_forced_.cos.transpose() * a + u_forced.cos.transpose() * b + functional.h.real();
  s.r.head(nf_) = q_forced_.sin.transpose() * a + u_forced.sin.transpose() * b + h_sin;
  s.p.segment(nf_, modes()) = Phi_.size() > 0 ? Eigen::VectorXd(Phi_.transpose() * a) : a;
  s.r.segment(nf_, modes()) = Phi_.size() > 0 ? Eigen::VectorXd(Phi_.transpose() * b) : b;
  if (path_ == FlowPath::dense) {
    const Eigen::ArrayXd psi_b = Psi_.transpose() * b;
    s.p.segment(nf_, modes()) -= oscillators_.kappa().segment(nf_, modes()) * psi_b;
    s.r.segment(nf_, modes()) -= 2.0 * oscillators_.delta().segment(nf_, modes()) * psi_b;
    s.r.segment(nf_, modes()) += (Psi_.transpose() * a).array();
  }
  return s;
}

void Flow::set_phases(Instant t, OscillatorState& x) const {
  const Eigen::VectorXd& Omega = dynamics_->frequencies();
  for (Eigen::Index j = 0; j < nf_; ++j) {
    // The phase Omega t in two pieces: at t = 400 the rounded product alone would cost 1e-13.
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
  if (&from != &to) to = from;
  oscillators_.propagate(from.x, from.alpha, t - from.t, nf_, modes(), to.x);
  to.t = t;
  set_phases(t, to.x);
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
    u.noalias() -= Psi_ * (oscillators_.kappa().segment(nf_, modes()) * z.array() +
                           2.0 * oscillators_.delta().segment(nf_, modes()) * v.array())
                              .matrix();
  }
  q += q_forced_.constant;
  q.noalias() += q_forced_.held * motion.held.head(q_forced_.held.cols());
  q.noalias() += q_forced_.cos * phases;
  q.noalias() += q_forced_.sin * phase_rates;
  u.noalias() += q_forced_.cos * phase_rates;
  for (Eigen::Index j = 0; j < nf_; ++j) {
    u -= oscillators_.kappa()[j] * phases[j] * q_forced_.sin.col(j);
  }
}

void Flow::kick(int contact, double Lambda, Motion& motion) const {
  motion.x.v.segment(nf_, modes()) += Lambda * kick_.col(contact).array();
}

const Flow& Flows::operator[](ContactSet locked) const {
  auto& flow = flows_[locked];
  if (!flow) flow = std::make_unique<Flow>(*dynamics_, locked);
  return *flow;
}

double value(const Signal& signal, const Motion& motion) {
  return signal.constant + signal.held.dot(motion.held) + (signal.p * motion.x.z).sum() +
         (signal.r * motion.x.v).sum();
}

double rate(const Signal& signal, const Motion& motion) {
  const Oscillators& o = motion.flow->oscillators();
  return (signal.p * motion.x.v +
          signal.r * (motion.alpha - 2.0 * o.delta() * motion.x.v - o.kappa() * motion.x.z))
      .sum();
}

}  // namespace sprag
