#include "sprag/mechanics/flow.h"

#include <Eigen/LU>
#include <bit>
#include <complex>

#include "sprag/mechanics/impact_law.h"
#include "sprag/mechanics/modal_analysis.h"
#include "sprag/mechanics/scale.h"

namespace sprag {
namespace {

using namespace modal;

// Beyond this many contacts, locked sets of three and more are built when they first occur.
constexpr int foreseeable_contacts = 4;
// A flow takes work in proportion to the cube of the coordinates' number: this much is some 50 ms.
constexpr double foreseeable_work = 2e6;

// What rounding leaves of a force on a mode that is at right angles to it, as a share of all.
constexpr Real no_force = 1e-16L;

constexpr int slot_bits = 14;
constexpr std::size_t flow_slots = 1 << slot_bits;
constexpr std::size_t most_flows = flow_slots / 4 * 3;

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

// B^T A B where that is known to be diagonal: no rounding of other entries gets into small ones.
MatrixR diagonal_of(const MatrixR& B, const MatrixR& A) {
  return VectorR(B.cwiseProduct(product(A, B)).colwise().sum().transpose()).asDiagonal();
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
  const ContactSet others = locked == 0 ? 0 : (bit(dynamics.contacts()) - 1) & ~locked;
  for_each(others, [&](int i) {
    if (independent_of(dynamics.G(), locked, bit(i)) == 0) tied_ |= bit(i);
  });
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

  MatrixCR Z(f, nf_);
  MatrixCR drive(f, nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const Eigen::VectorXcd forcing =
        dynamics_->force_amplitudes().col(j).cwiseQuotient(mass.cast<std::complex<double>>());
    const Response r = response(delta, kappa, forcing.cast<Complex>(), Omega[j], 0);
    Z.col(j) = r.steady;
    drive.col(j) = r.drive;
  }
  q_forced_ = forced(MatrixR::Zero(f, 1), Z);
  u_forced_ = rate(q_forced_);
  z_forced_ = q_forced_;
  v_forced_ = u_forced_;
  const VectorR alpha = (dynamics_->force_constant().array() / mass.array()).matrix().cast<Real>();
  set_bank(delta, kappa, alpha, drive);
  kick_ = dynamics_->MinvW();
}

// The motion y on null(W_L^T), q = B y + q_D, y'' + C y' + K y = push (1, g_L) + Re forcing
// e^(i Omega t). The locked contacts carry q_D = D (g_L - c_L - s_L(t)) along, M-orthogonal to it.
struct Flow::Nullspace {
  MatrixR B, to_y;  // y = to_y q
  MatrixR C, K;
  MatrixR push;  // its first column stands alone, the others multiply g_L; so does q_D
  MatrixCR forcing;
  MatrixR q_D;
  MatrixCR q_D_harmonics;
};

Flow::Forced Flow::forced(const MatrixR& push, const MatrixCR& harmonics) const {
  Forced forced{push.col(0).cast<double>(), push.rightCols(push.cols() - 1).cast<double>(), {}, {}};
  set_harmonics(harmonics.cast<std::complex<double>>(), forced);
  return forced;
}

void Flow::build_on_nullspace() {
  const Model& model = dynamics_->model();
  const Eigen::Index f = model.coordinates();
  const auto l = static_cast<Eigen::Index>(locked_contacts_.size());
  // Modes of mass 1, in a unit of M's own: roots of M are the same whatever unit it comes in.
  const double mass = power_of_two_above(model.M.diagonal().maxCoeff());
  const MatrixR M = (model.M / mass).cast<Real>();
  const MatrixR C = (model.C / mass).cast<Real>();
  const MatrixR K = (model.K / mass).cast<Real>();
  MatrixR W(f, l);
  VectorR offsets(l);
  MatrixCR motion(l, nf_);
  for (Eigen::Index i = 0; i < l; ++i) {
    const int contact = locked_contacts_[static_cast<std::size_t>(i)];
    W.col(i) = dynamics_->W().col(contact).cast<Real>();
    offsets[i] = dynamics_->offsets()[contact];
    motion.row(i) = dynamics_->motion_amplitudes().row(contact).cast<Complex>();
  }

  Nullspace space;
  MatrixR& B = space.B;
  B = constrained_basis(M, W, locked_contacts_);
  MatrixR V;
  const bool modal = diagonalize(congruent(B, K), congruent(B, C), V);
  if (modal) B = product(B, V);
  space.to_y = product(M, B).transpose();
  space.C = modal ? diagonal_of(B, C) : congruent(B, C);
  space.K = modal ? diagonal_of(B, K) : congruent(B, K);

  const MatrixR MinvW = solve_definite(M, W);
  const MatrixR D =
      l > 0 ? product(MinvW, inverse(product(W.transpose(), MinvW))) : MatrixR::Zero(f, 0);
  space.q_D.resize(f, 1 + l);
  space.q_D << -D * offsets, D;
  const MatrixCR supports = complex_product(D, motion);
  space.q_D_harmonics = -supports;
  space.push = -product(B.transpose(), product(K, space.q_D));
  space.push.col(0) += B.transpose() * (dynamics_->force_constant() / mass).cast<Real>();
  space.forcing.resize(B.cols(), nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const Complex i_Omega(0, dynamics_->frequencies()[j]);
    const MatrixCR Z = K.cast<Complex>() + i_Omega * C.cast<Complex>();
    const VectorCR F = (dynamics_->force_amplitudes().col(j) / mass).cast<Complex>();
    space.forcing.col(j) = B.transpose().cast<Complex>() * (F + Z * supports.col(j));
  }

  if (modal) {
    build_modal(space);
  } else {
    build_dense(space);
  }
}

void Flow::build_modal(const Nullspace& space) {
  path_ = FlowPath::modal;
  const Eigen::Index r = space.B.cols();
  const VectorR delta = space.C.diagonal().cwiseMax(Real(0)) / 2;
  VectorR kappa = space.K.diagonal();
  drop_noise(kappa);
  const MatrixR none = MatrixR::Zero(r, space.push.cols());
  MatrixCR Z(r, nf_);
  MatrixCR drive(r, nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const Response response =
        modal::response(delta, kappa, space.forcing.col(j), dynamics_->frequencies()[j], no_force);
    Z.col(j) = response.steady;
    drive.col(j) = response.drive;
  }

  Phi_ = space.B.cast<double>();
  enter_zq_ = space.to_y.cast<double>();
  enter_vu_ = enter_zq_;
  kick_ = enter_zq_ * dynamics_->MinvW();
  z_forced_ = forced(none, Z);
  v_forced_ = rate(z_forced_);
  q_forced_ = forced(space.q_D, complex_product(space.B, Z) + space.q_D_harmonics);
  u_forced_ = rate(q_forced_);
  set_bank(delta, kappa, space.push, drive);
}

void Flow::build_dense(const Nullspace& space) {
  path_ = FlowPath::dense;
  const Eigen::Index r = space.B.cols();
  const ComplexModes modes = complex_modes(space.K, space.C);
  const VectorR& delta = modes.delta;
  const VectorR& kappa = modes.kappa;

  // [y; y'] = T [z; v] with z' = v + beta_z and v' = -kappa z - 2 delta v + beta_v, where beta is
  // what T^-1 makes of a force. v is not the rate of z then; that of z minus a particular motion
  // is v minus that motion's own.
  const MatrixR from_force = modes.T_inverse.rightCols(r);
  const MatrixR beta = product(from_force, space.push);
  const auto beta_z = beta.topRows(r);
  const MatrixR none = MatrixR::Zero(r, beta.cols());
  const MatrixR alpha = beta.bottomRows(r) + 2 * delta.asDiagonal() * beta_z;
  const MatrixR v = -beta_z;
  MatrixCR Z(r, nf_);
  MatrixCR V(r, nf_);
  MatrixCR drive(r, nf_);
  for (Eigen::Index j = 0; j < nf_; ++j) {
    const Complex i_Omega(0, dynamics_->frequencies()[j]);
    const VectorCR b = from_force.cast<Complex>() * space.forcing.col(j);
    const VectorCR forcing =
        b.tail(r) + 2 * delta.cast<Complex>().cwiseProduct(b.head(r)) + i_Omega * b.head(r);
    const Response response =
        modal::response(delta, kappa, forcing, dynamics_->frequencies()[j], no_force);
    Z.col(j) = response.steady;
    V.col(j) = i_Omega * Z.col(j) - b.head(r);
    drive.col(j) = response.drive;
  }

  const MatrixR BP = product(space.B, modes.P);
  const MatrixR BR = product(space.B, modes.R);
  Phi_ = BP.cast<double>();
  Psi_ = BR.cast<double>();
  enter_zq_ = product(modes.T_inverse.topLeftCorner(r, r), space.to_y).cast<double>();
  enter_zu_ = product(modes.T_inverse.topRightCorner(r, r), space.to_y).cast<double>();
  enter_vq_ = product(modes.T_inverse.bottomLeftCorner(r, r), space.to_y).cast<double>();
  enter_vu_ = product(modes.T_inverse.bottomRightCorner(r, r), space.to_y).cast<double>();
  z_forced_ = forced(none, Z);
  v_forced_ = forced(v, V);
  q_forced_ = forced(product(BR, v) + space.q_D,
                     complex_product(BP, Z) + complex_product(BR, V) + space.q_D_harmonics);
  u_forced_ = rate(q_forced_);
  const Forced pushed = forced(product(BR, alpha), complex_product(BR, drive));
  u_forced_.constant += pushed.constant;
  u_forced_.held += pushed.held;
  u_forced_.cos += pushed.cos;
  u_forced_.sin += pushed.sin;
  set_bank(delta, kappa, alpha, drive);
}

// alpha as push in Nullspace, drive by frequency; modes in the order of delta and kappa.
void Flow::set_bank(const VectorR& delta, const VectorR& kappa, const MatrixR& alpha,
                    const MatrixCR& drive) {
  const Eigen::Index f = dynamics_->coordinates();
  const Eigen::VectorXd& Omega = dynamics_->frequencies();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(nf_);
  oscillators_ = Oscillators(behind_frequencies(none, delta, f),
                             behind_frequencies(Omega.cwiseAbs2(), kappa, f));
  alpha0_ = behind_frequencies(none, alpha.col(0), f);
  alpha_held_ = Eigen::MatrixXd::Zero(size(), alpha.cols() - 1);
  alpha_held_.middleRows(nf_, alpha.rows()) = alpha.rightCols(alpha.cols() - 1).cast<double>();
  std::vector<Drive> drives;
  for (Eigen::Index j = 0; j < nf_; ++j) {
    for (Eigen::Index i = 0; i < drive.rows(); ++i) {
      const auto A = static_cast<std::complex<double>>(drive(i, j));
      if (A != 0.0) drives.push_back({nf_ + i, j, A.real(), A.imag() / Omega[j]});
    }
  }
  drives_ = Drives(oscillators_, std::move(drives));
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
    gap_velocity_[static_cast<std::size_t>(i)] =
        contains(tied_, i) ? tied_gap_velocity(i) : signal(dynamics_->gap_velocity(i));
  }

  // lambda_L = -G_L^-1 (gamma_L' without contact forces).
  const Eigen::MatrixXd G = of_contacts(dynamics_->G(), locked_);
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

// Of a contact that L moves gamma is what its support moves otherwise than those of L: nothing, not
// even rounding, where they move alike.
Signal Flow::tied_gap_velocity(int contact) const {
  constexpr double nothing = 1e-12;  // of the terms
  const Functional gamma = dynamics_->gap_velocity(contact);
  Signal s = signal(gamma);
  const Eigen::VectorXd b = gamma.b.cwiseAbs();
  const Eigen::VectorXd p = u_forced_.cos.cwiseAbs().transpose() * b + gamma.h.real().cwiseAbs();
  const Eigen::VectorXd r = u_forced_.sin.cwiseAbs().transpose() * b +
                            gamma.h.imag().cwiseAbs().cwiseQuotient(dynamics_->frequencies());
  for (Eigen::Index j = 0; j < nf_; ++j) {
    if (std::abs(s.p[j]) <= nothing * p[j]) s.p[j] = 0.0;
    if (std::abs(s.r[j]) <= nothing * r[j]) s.r[j] = 0.0;
  }
  s.p.tail(size() - nf_).setZero();
  s.r.tail(size() - nf_).setZero();
  s.constant = 0.0;
  s.held.setZero();
  return s;
}

Signal Flow::signal(const Functional& functional) const {
  const Eigen::VectorXd& a = functional.a;
  const Eigen::VectorXd& b = functional.b;
  Signal s{Eigen::ArrayXd::Zero(size()), Eigen::ArrayXd::Zero(size()), 0.0, {}};
  s.constant = functional.constant + a.dot(q_forced_.constant) + b.dot(u_forced_.constant);
  s.held = Eigen::VectorXd::Zero(dynamics_->contacts());
  s.held.head(q_forced_.held.cols()) =
      q_forced_.held.transpose() * a + u_forced_.held.transpose() * b;
  const Eigen::VectorXd h_sin = functional.h.imag().cwiseQuotient(dynamics_->frequencies());
  s.p.head(nf_) =
      q_forced_.cos.transpose() * a + u_forced_.cos.transpose() * b + functional.h.real();
  s.r.head(nf_) = q_forced_.sin.transpose() * a + u_forced_.sin.transpose() * b + h_sin;
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
  const double tau = t - from.t;
  if (&from != &to) to = from;
  move_modes(from, tau, modes(), to.x);
  to.t = t;
  set_phases(t, to.x);
}

void Flow::move_modes(const Motion& from, double tau, Eigen::Index count,
                      OscillatorState& x) const {
  oscillators_.propagate(from.x, from.alpha, tau, nf_, count, x);
  if (!drives_.empty()) drives_.respond(oscillators_, from.x, tau, nf_ + count, x);
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

// Products coefficient by coefficient: blocked ones allocate.
void Flow::enter_differences(const Eigen::Ref<const Eigen::MatrixXd>& q,
                             const Eigen::Ref<const Eigen::MatrixXd>& u,
                             Eigen::Ref<Eigen::MatrixXd> z, Eigen::Ref<Eigen::MatrixXd> v) const {
  if (path_ == FlowPath::diagonal) {
    z = q;
    v = u;
    return;
  }
  z.noalias() = enter_zq_.lazyProduct(q);
  v.noalias() = enter_vu_.lazyProduct(u);
  if (path_ == FlowPath::dense) {
    z.noalias() += enter_zu_.lazyProduct(u);
    v.noalias() += enter_vq_.lazyProduct(q);
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
  q.noalias() = Phi_.lazyProduct(z);
  u.noalias() = Phi_.lazyProduct(v);
  if (path_ != FlowPath::dense) return;
  q.noalias() += Psi_.lazyProduct(v);
  for (Eigen::Index i = 0; i < modes(); ++i) {
    const double kappa = oscillators_.kappa()[nf_ + i];
    const double delta = oscillators_.delta()[nf_ + i];
    for (Eigen::Index k = 0; k < z.cols(); ++k) {
      u.col(k) -= (kappa * z(i, k) + 2.0 * delta * v(i, k)) * Psi_.col(i);
    }
  }
}

void Flow::kick(int contact, double Lambda, Motion& motion) const {
  motion.x.v.segment(nf_, modes()) += Lambda * kick_.col(contact).array();
}

struct Flows::Entry {
  ContactSet locked;
  std::unique_ptr<const Flow> flow;
  std::string why_not;
};

Flows::Flows(Model model) : dynamics_(std::move(model)), slots_(flow_slots) { (void)(*this)[0]; }

Flows::~Flows() = default;

// The slot of this set, or the free one where it belongs.
std::atomic<const Flows::Entry*>& Flows::slot(ContactSet locked) const {
  // Fibonacci hashing by the product's top bits, on which all contacts have an influence: sets of
  // few contacts are spread over all slots.
  std::size_t i = (locked * 0x9E3779B97F4A7C15U) >> (64 - slot_bits);
  while (true) {
    const Entry* entry = slots_[i].load(std::memory_order_acquire);
    if (entry == nullptr || entry->locked == locked) return slots_[i];
    i = (i + 1) % flow_slots;
  }
}

const Flows::Entry* Flows::entry(ContactSet locked) const {
  return slot(locked).load(std::memory_order_acquire);
}

const Flows::Entry* Flows::entry_when_built(ContactSet locked) const {
  if (const Entry* known = entry(locked)) return known;
  if (missing_) {
    missing_(locked);
  } else {
    build(locked);
  }
  return entry(locked);
}

void Flows::build(ContactSet locked) const {
  if (built(locked) || entries_.size() >= most_flows) return;
  Entry entry{locked, nullptr, {}};
  try {
    entry.flow = std::make_unique<const Flow>(dynamics_, locked);
  } catch (const ModelError& error) {
    entry.why_not = error.what();
  }
  entries_.push_back(std::make_unique<const Entry>(std::move(entry)));
  slot(locked).store(entries_.back().get(), std::memory_order_release);
}

const Flow* Flows::find(ContactSet locked) const {
  const Entry* known = entry_when_built(locked);
  return known == nullptr ? nullptr : known->flow.get();
}

const Flow& Flows::operator[](ContactSet locked) const {
  const Entry* known = entry_when_built(locked);
  if (known == nullptr) throw ModelError("too many sets of locked contacts");
  if (known->flow == nullptr) throw ModelError(known->why_not);
  return *known->flow;
}

void build_foreseeable(const Flows& flows) {
  const int m = flows.dynamics().contacts();
  const auto f = static_cast<double>(flows.dynamics().coordinates());
  double work = 0.0;
  const auto build = [&](ContactSet locked) {
    work += f * f * f;
    if (work > foreseeable_work) return;
    flows.build(locked);
  };
  for (int i = 0; i < m; ++i) build(bit(i));
  if (m <= foreseeable_contacts) {
    for (ContactSet locked = 0; locked < bit(m); ++locked) build(locked);
    return;
  }
  for (int i = 0; i < m && work <= foreseeable_work; ++i) {
    for (int j = 0; j < i; ++j) build(bit(i) | bit(j));
  }
}

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
  return sum;
}

}  // namespace sprag
