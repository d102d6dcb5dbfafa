// Construction of a flow: modes of the machine on the null space of the locked contacts'
// directions, in extended precision (modal_analysis.h), and their response to the excitation.
#include <cmath>
#include <complex>
#include <cstddef>
#include <utility>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/modal_analysis.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {

using namespace modal;

namespace {

// Rounding level of a force that is orthogonal to a mode, as a fraction of the largest force.
constexpr Real no_force = 1e-16L;

std::vector<int> members(ContactSet set) {
  std::vector<int> list;
  for (int i = 0; i < max_contacts; ++i) {
    if (contains(set, i)) list.push_back(i);
  }
  return list;
}

// Locked contacts remove modes. The bank keeps its size: oscillators at rest fill their places.
Eigen::ArrayXd trailing_frequencies(const Eigen::VectorXd& front, const VectorR& modes,
                                    Eigen::Index coordinates) {
  Eigen::ArrayXd all = Eigen::ArrayXd::Zero(front.size() + coordinates);
  all.head(front.size()) = front.array();
  all.segment(front.size(), modes.size()) = modes.cast<double>().array();
  return all;
}

// B^T A B where the product is known to be diagonal. Other entries, which are rounding, are
// dropped.
MatrixR diagonal_of(const MatrixR& B, const MatrixR& A) {
  return VectorR(B.cwiseProduct(product(A, B)).colwise().sum().transpose()).asDiagonal();
}

// K^-1 push for modes with stiffnesses kappa; zero for modes without stiffness.
MatrixR at_rest(const VectorR& kappa, const MatrixR& push) {
  MatrixR y = push;
  for (Eigen::Index i = 0; i < kappa.size(); ++i) y.row(i) *= kappa[i] > 0 ? 1 / kappa[i] : Real(0);
  return y;
}

}  // namespace

class Flow::Builder {
 public:
  explicit Builder(Flow& flow)
      : flow_(flow),
        dynamics_(*flow.dynamics_),
        nh_(flow.nh_),
        nf_(flow.nf_),
        locked_contacts_(members(flow.locked_)) {}

  void build();

 private:
  struct Nullspace;

  void build_diagonal();
  void build_on_nullspace();
  void build_modal(const Nullspace& space);
  void build_dense(const Nullspace& space);
  void set_bank(const VectorR& delta, const VectorR& kappa, const MatrixR& alpha,
                const MatrixCR& drive);
  void build_signals();
  Signal tied_gap_velocity(int contact) const;
  Forced forced(const MatrixR& push, const MatrixCR& harmonics) const;
  Forced rate(const Forced& forced) const;
  void set_harmonics(const Eigen::MatrixXcd& A, Forced& forced) const;
  void set_static_shapes(const Nullspace& space, const MatrixR& y);
  bool sampled() const { return !dynamics_.inputs().empty(); }
  void widen(Forced& forced) const;
  void set_chain(const Eigen::MatrixXd& chain, Forced& forced) const;
  void add_sampled(const MatrixR& q_chain, const MatrixR& v_chain, const MatrixR& forces);

  Flow& flow_;
  const Dynamics& dynamics_;
  Eigen::Index nh_, nf_;
  std::vector<int> locked_contacts_;
};

Flow::Flow(const Dynamics& dynamics, ContactSet locked)
    : dynamics_(&dynamics), locked_(locked), nh_(dynamics.frequencies().size()), nf_(nh_) {
  if (!dynamics.inputs().empty()) {
    nf_ += chain_entries * dynamics.inputs().channels() + dynamics.coordinates();
  }
  Builder(*this).build();
}

void Flow::Builder::build() {
  const ContactSet locked = flow_.locked_;
  flow_.modes_ = dynamics_.coordinates() - static_cast<Eigen::Index>(locked_contacts_.size());
  if (locked == 0 && dynamics_.diagonal()) {
    build_diagonal();
  } else {
    build_on_nullspace();
  }
  const ContactSet others = locked == 0 ? 0 : (bit(dynamics_.contacts()) - 1) & ~locked;
  for_each(others, [&](int i) {
    if (independent_of(dynamics_.G(), locked, bit(i)) == 0) flow_.tied_ |= bit(i);
  });
  build_signals();
}

// Columns cos and sin of Re(A_j e^(i Omega_j t)) = Re A_j z_f + Im A_j / Omega_j z_f'.
void Flow::Builder::set_harmonics(const Eigen::MatrixXcd& A, Forced& forced) const {
  forced.cos = A.real();
  forced.sin = A.imag() * dynamics_.frequencies().cwiseInverse().asDiagonal();
}

Flow::Forced Flow::Builder::rate(const Forced& forced) const {
  return {Eigen::VectorXd::Zero(forced.constant.size()),
          Eigen::MatrixXd::Zero(forced.held.rows(), forced.held.cols()),
          -forced.sin * dynamics_.frequencies().cwiseAbs2().asDiagonal(), forced.cos};
}

void Flow::Builder::build_diagonal() {
  flow_.path_ = FlowPath::diagonal;
  const Model& model = dynamics_.model();
  const Eigen::Index f = model.coordinates();
  const Eigen::VectorXd mass = model.M.diagonal();
  const VectorR delta = (model.C.diagonal().array() / mass.array() / 2.0).matrix().cast<Real>();
  const VectorR kappa = (model.K.diagonal().array() / mass.array()).matrix().cast<Real>();
  const Eigen::VectorXd& Omega = dynamics_.frequencies();

  MatrixCR Z(f, nh_);
  MatrixCR drive(f, nh_);
  for (Eigen::Index j = 0; j < nh_; ++j) {
    const Eigen::VectorXcd forcing =
        dynamics_.force_amplitudes().col(j).cwiseQuotient(mass.cast<std::complex<double>>());
    const Response r = response(delta, kappa, forcing.cast<Complex>(), Omega[j], 0);
    Z.col(j) = r.steady;
    drive.col(j) = r.drive;
  }
  flow_.q_forced_ = forced(MatrixR::Zero(f, 1), Z);
  flow_.u_forced_ = rate(flow_.q_forced_);
  flow_.z_forced_ = flow_.q_forced_;
  flow_.v_forced_ = flow_.u_forced_;
  const VectorR alpha = (dynamics_.force_constant().array() / mass.array()).matrix().cast<Real>();
  set_bank(delta, kappa, alpha, drive);
  flow_.kick_ = dynamics_.MinvW();
  if (!sampled()) return;
  const SampledInputs& inputs = dynamics_.inputs();
  const MatrixR none = MatrixR::Zero(f, chain_terms * inputs.channels());
  MatrixR forces = none;
  for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
    forces.col(chain_terms * c + 2) = inputs.forces().col(c).cwiseQuotient(mass).cast<Extended>();
  }
  add_sampled(none, none, forces);
}

// The motion y on null(W_L^T), q = B y + q_D, with y'' + C y' + K y = push (1, g_L) + Re forcing
// e^(i Omega t). q_D = D (g_L - c_L - s_L(t)) is the motion that the locked contacts impose; it is
// M-orthogonal to B y.
struct Flow::Builder::Nullspace {
  MatrixR B, to_y;  // y = to_y q
  MatrixR C, K;
  MatrixR push;  // column 0 is constant, the others multiply g_L; the same holds for q_D
  MatrixCR forcing;
  MatrixR q_D;
  MatrixCR q_D_harmonics;
  // Columns multiply the derivatives of the sampled inputs.
  MatrixR q_D_chain, forcing_chain;
};

// Adds zero columns for the entries of sampled inputs.
void Flow::Builder::widen(Forced& forced) const {
  for (Eigen::MatrixXd* columns : {&forced.cos, &forced.sin}) {
    const Eigen::MatrixXd harmonics = *columns;
    columns->setZero(harmonics.rows(), nf_);
    columns->leftCols(nh_) = harmonics;
  }
}

// `chain` has a column for each derivative of each input. Even derivatives are the values of
// prescribed entries, odd ones their rates.
void Flow::Builder::set_chain(const Eigen::MatrixXd& chain, Forced& forced) const {
  for (Eigen::Index j = 0; 2 * j < chain.cols(); ++j) {
    forced.cos.col(nh_ + j) = chain.col(2 * j);
    forced.sin.col(nh_ + j) = chain.col(2 * j + 1);
  }
}

namespace {

// The time derivative of a function of the inputs' derivatives, of which the last is constant.
MatrixR chain_rate(const MatrixR& chain) {
  MatrixR rate = MatrixR::Zero(chain.rows(), chain.cols());
  for (Eigen::Index j = 0; j + 1 < chain.cols(); ++j) {
    if ((j + 1) % chain_terms != 0) rate.col(j + 1) = chain.col(j);
  }
  return rate;
}

}  // namespace

// The modes z obey z'' + 2 delta z' + kappa z = forces d, with d the derivatives of the inputs, and
// q = Phi z + Psi z' + q_chain d. The bank's v is z' + v_chain d. With z = y + (motion of the
// bank), y the response, all vectors get terms of y and d.
void Flow::Builder::add_sampled(const MatrixR& q_chain, const MatrixR& v_chain,
                                const MatrixR& forces) {
  const SampledInputs& inputs = dynamics_.inputs();
  const Eigen::Index r = forces.rows();
  const Eigen::Index y = nh_ + chain_entries * inputs.channels();
  for (Forced* of : {&flow_.q_forced_, &flow_.u_forced_, &flow_.z_forced_, &flow_.v_forced_}) {
    widen(*of);
  }
  flow_.z_forced_.cos.middleCols(y, r).setIdentity();
  flow_.v_forced_.sin.middleCols(y, r).setIdentity();
  set_chain(v_chain.cast<double>(), flow_.v_forced_);
  MatrixR u_chain = chain_rate(q_chain);
  Forced& q = flow_.q_forced_;
  Forced& u = flow_.u_forced_;
  if (flow_.path_ == FlowPath::diagonal) {
    q.cos.middleCols(y, r).setIdentity();
    u.sin.middleCols(y, r).setIdentity();
  } else {
    q.cos.middleCols(y, r) = flow_.Phi_;
    u.sin.middleCols(y, r) = flow_.Phi_;
  }
  const Eigen::VectorXd delta = flow_.oscillators_.delta().segment(nf_, r).matrix();
  const Eigen::VectorXd kappa = flow_.oscillators_.kappa().segment(nf_, r).matrix();
  if (flow_.path_ == FlowPath::dense) {
    // u = q' contains Psi z'' = Psi (forces d - kappa y - 2 delta y').
    q.sin.middleCols(y, r) = flow_.Psi_;
    u.cos.middleCols(y, r) = -flow_.Psi_ * kappa.asDiagonal();
    u.sin.middleCols(y, r) -= 2.0 * flow_.Psi_ * delta.asDiagonal();
    u_chain += product(flow_.Psi_.cast<Extended>(), forces);
  }
  set_chain(q_chain.cast<double>(), q);
  set_chain(u_chain.cast<double>(), u);
  flow_.sampled_ =
      std::make_unique<SampledResponse>(inputs, delta, kappa, forces.cast<double>(), nh_, y);
}

Flow::Forced Flow::Builder::forced(const MatrixR& push, const MatrixCR& harmonics) const {
  Forced forced{push.col(0).cast<double>(), push.rightCols(push.cols() - 1).cast<double>(), {}, {}};
  set_harmonics(harmonics.cast<std::complex<double>>(), forced);
  return forced;
}

void Flow::Builder::build_on_nullspace() {
  const Model& model = dynamics_.model();
  const Eigen::Index f = model.coordinates();
  const auto l = static_cast<Eigen::Index>(locked_contacts_.size());
  // Unit modal masses. M is scaled by a power of two, so that roots do not depend on its unit.
  const double mass = power_of_two_above(model.M.diagonal().maxCoeff());
  const MatrixR M = (model.M / mass).cast<Real>();
  const MatrixR C = (model.C / mass).cast<Real>();
  const MatrixR K = (model.K / mass).cast<Real>();
  MatrixR W(f, l);
  VectorR offsets(l);
  MatrixCR motion(l, nh_);
  for (Eigen::Index i = 0; i < l; ++i) {
    const int contact = locked_contacts_[static_cast<std::size_t>(i)];
    W.col(i) = dynamics_.W().col(contact).cast<Real>();
    offsets[i] = dynamics_.offsets()[contact];
    motion.row(i) = dynamics_.motion_amplitudes().row(contact).cast<Complex>();
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
  space.q_D << -product(D, offsets), D;
  const MatrixCR supports = complex_product(D, motion);
  space.q_D_harmonics = -supports;
  space.push = -product(B.transpose(), product(K, space.q_D));
  space.push.col(0) += product(B.transpose(), (dynamics_.force_constant() / mass).cast<Real>());
  space.forcing.resize(B.cols(), nh_);
  for (Eigen::Index j = 0; j < nh_; ++j) {
    const Complex i_Omega(0, dynamics_.frequencies()[j]);
    const VectorCR q = supports.col(j);
    const VectorCR F = (dynamics_.force_amplitudes().col(j) / mass).cast<Complex>();
    const VectorCR of_support = complex_product(K, q) + i_Omega * complex_product(C, q);
    space.forcing.col(j) = complex_product(B.transpose(), F + of_support);
  }
  if (sampled()) {
    const SampledInputs& inputs = dynamics_.inputs();
    space.q_D_chain = MatrixR::Zero(f, chain_terms * inputs.channels());
    space.forcing_chain = MatrixR::Zero(B.cols(), chain_terms * inputs.channels());
    for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
      VectorR shares(l);
      for (Eigen::Index i = 0; i < l; ++i) {
        shares[i] = inputs.motions()(locked_contacts_[static_cast<std::size_t>(i)], c);
      }
      const VectorR support = product(D, shares);
      const VectorR of_force = (inputs.forces().col(c) / mass).cast<Extended>();
      const Eigen::Index e = chain_terms * c;
      space.q_D_chain.col(e) = -support;
      space.forcing_chain.col(e) = product(B.transpose(), product(K, support));
      space.forcing_chain.col(e + 1) = product(B.transpose(), product(C, support));
      space.forcing_chain.col(e + 2) = product(B.transpose(), of_force);
    }
  }

  if (modal) {
    build_modal(space);
  } else {
    build_dense(space);
  }
}

// Column i of y is the static deflection of the modes per unit gap of locked contact i.
void Flow::Builder::set_static_shapes(const Nullspace& space, const MatrixR& y) {
  const auto q_D = space.q_D.rightCols(y.cols());
  flow_.static_shapes_ = (q_D + product(space.B, y)).cast<double>();
}

void Flow::Builder::build_modal(const Nullspace& space) {
  flow_.path_ = FlowPath::modal;
  const Eigen::Index r = space.B.cols();
  const VectorR delta = space.C.diagonal().cwiseMax(Real(0)) / 2;
  VectorR kappa = space.K.diagonal();
  drop_noise(kappa);
  set_static_shapes(space, at_rest(kappa, space.push.rightCols(space.push.cols() - 1)));
  const MatrixR none = MatrixR::Zero(r, space.push.cols());
  MatrixCR Z(r, nh_);
  MatrixCR drive(r, nh_);
  for (Eigen::Index j = 0; j < nh_; ++j) {
    const Response response =
        modal::response(delta, kappa, space.forcing.col(j), dynamics_.frequencies()[j], no_force);
    Z.col(j) = response.steady;
    drive.col(j) = response.drive;
  }

  flow_.Phi_ = space.B.cast<double>();
  flow_.enter_zq_ = space.to_y.cast<double>();
  flow_.enter_vu_ = flow_.enter_zq_;
  flow_.kick_ = product(flow_.enter_zq_, dynamics_.MinvW());
  flow_.z_forced_ = forced(none, Z);
  flow_.v_forced_ = rate(flow_.z_forced_);
  flow_.q_forced_ = forced(space.q_D, complex_product(space.B, Z) + space.q_D_harmonics);
  flow_.u_forced_ = rate(flow_.q_forced_);
  set_bank(delta, kappa, space.push, drive);
  if (!sampled()) return;
  const MatrixR no_chain = MatrixR::Zero(r, space.forcing_chain.cols());
  add_sampled(space.q_D_chain, no_chain, space.forcing_chain);
}

void Flow::Builder::build_dense(const Nullspace& space) {
  flow_.path_ = FlowPath::dense;
  const Eigen::Index r = space.B.cols();
  if (flow_.locked_ != 0) {
    ExtendedEigenpairs of_K = eigenpairs(space.K);
    drop_noise(of_K.values);
    const MatrixR push =
        product(of_K.vectors.transpose(), space.push.rightCols(space.push.cols() - 1));
    set_static_shapes(space, product(of_K.vectors, at_rest(of_K.values, push)));
  }
  const ComplexModes modes = complex_modes(space.K, space.C);
  const VectorR& delta = modes.delta;
  const VectorR& kappa = modes.kappa;

  // [y; y'] = T [z; v] with z' = v + beta_z and v' = -kappa z - 2 delta v + beta_v, where beta is
  // T^-1 applied to the force. v is not z' here; but the rate of z minus a particular solution is v
  // minus that solution's v.
  const MatrixR from_force = modes.T_inverse.rightCols(r);
  const MatrixR beta = product(from_force, space.push);
  const auto beta_z = beta.topRows(r);
  const MatrixR none = MatrixR::Zero(r, beta.cols());
  const MatrixR alpha = beta.bottomRows(r) + 2 * delta.asDiagonal() * beta_z;
  const MatrixR v = -beta_z;
  MatrixCR Z(r, nh_);
  MatrixCR V(r, nh_);
  MatrixCR drive(r, nh_);
  for (Eigen::Index j = 0; j < nh_; ++j) {
    const Complex i_Omega(0, dynamics_.frequencies()[j]);
    const VectorCR b = complex_product(from_force, space.forcing.col(j));
    const VectorCR forcing =
        b.tail(r) + 2 * delta.cast<Complex>().cwiseProduct(b.head(r)) + i_Omega * b.head(r);
    const Response response =
        modal::response(delta, kappa, forcing, dynamics_.frequencies()[j], no_force);
    Z.col(j) = response.steady;
    V.col(j) = i_Omega * Z.col(j) - b.head(r);
    drive.col(j) = response.drive;
  }

  const MatrixR BP = product(space.B, modes.P);
  const MatrixR BR = product(space.B, modes.R);
  flow_.Phi_ = BP.cast<double>();
  flow_.Psi_ = BR.cast<double>();
  flow_.enter_zq_ = product(modes.T_inverse.topLeftCorner(r, r), space.to_y).cast<double>();
  flow_.enter_zu_ = product(modes.T_inverse.topRightCorner(r, r), space.to_y).cast<double>();
  flow_.enter_vq_ = product(modes.T_inverse.bottomLeftCorner(r, r), space.to_y).cast<double>();
  flow_.enter_vu_ = product(modes.T_inverse.bottomRightCorner(r, r), space.to_y).cast<double>();
  flow_.z_forced_ = forced(none, Z);
  flow_.v_forced_ = forced(v, V);
  flow_.q_forced_ = forced(product(BR, v) + space.q_D,
                           complex_product(BP, Z) + complex_product(BR, V) + space.q_D_harmonics);
  flow_.u_forced_ = rate(flow_.q_forced_);
  const Forced pushed = forced(product(BR, alpha), complex_product(BR, drive));
  flow_.u_forced_.constant += pushed.constant;
  flow_.u_forced_.held += pushed.held;
  flow_.u_forced_.cos += pushed.cos;
  flow_.u_forced_.sin += pushed.sin;
  set_bank(delta, kappa, alpha, drive);
  if (!sampled()) return;
  const MatrixR b = product(from_force, space.forcing_chain);
  const MatrixR b_z = b.topRows(r);
  const MatrixR b_v = b.bottomRows(r);
  const MatrixR v_chain = -b_z;
  add_sampled(product(BR, v_chain) + space.q_D_chain, v_chain,
              b_v + 2 * delta.asDiagonal() * b_z + chain_rate(b_z));
}

// alpha has columns as Nullspace::push, drive one column per frequency. Modes are in the order of
// delta and kappa.
void Flow::Builder::set_bank(const VectorR& delta, const VectorR& kappa, const MatrixR& alpha,
                             const MatrixCR& drive) {
  const Eigen::Index f = dynamics_.coordinates();
  const Eigen::VectorXd& Omega = dynamics_.frequencies();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(nf_);
  Eigen::VectorXd front_delta = none;
  Eigen::VectorXd front_kappa = none;
  front_kappa.head(nh_) = Omega.cwiseAbs2();
  if (sampled()) {
    front_delta.segment(nf_ - f, delta.size()) = delta.cast<double>();
    front_kappa.segment(nf_ - f, kappa.size()) = kappa.cast<double>();
  }
  flow_.oscillators_ = Oscillators(trailing_frequencies(front_delta, delta, f),
                                   trailing_frequencies(front_kappa, kappa, f));
  flow_.alpha0_ = trailing_frequencies(none, alpha.col(0), f);
  flow_.alpha_held_ = Eigen::MatrixXd::Zero(flow_.size(), alpha.cols() - 1);
  flow_.alpha_held_.middleRows(nf_, alpha.rows()) =
      alpha.rightCols(alpha.cols() - 1).cast<double>();
  std::vector<Drive> drives;
  for (Eigen::Index j = 0; j < nh_; ++j) {
    for (Eigen::Index i = 0; i < drive.rows(); ++i) {
      const auto A = static_cast<std::complex<double>>(drive(i, j));
      if (A != 0.0) drives.push_back({nf_ + i, j, A.real(), A.imag() / Omega[j]});
    }
  }
  flow_.drives_ = Drives(flow_.oscillators_, std::move(drives));
}

void Flow::Builder::build_signals() {
  const int m = dynamics_.contacts();
  const auto l = static_cast<Eigen::Index>(locked_contacts_.size());
  const auto count = static_cast<std::size_t>(m);
  flow_.gap_.resize(count);
  flow_.gap_velocity_.resize(count);
  flow_.force_.resize(count);
  for (int i = 0; i < m; ++i) {
    if (contains(flow_.locked_, i)) continue;
    flow_.gap_[static_cast<std::size_t>(i)] = flow_.signal(dynamics_.gap(i));
    flow_.gap_velocity_[static_cast<std::size_t>(i)] =
        contains(flow_.tied_, i) ? tied_gap_velocity(i) : flow_.signal(dynamics_.gap_velocity(i));
  }

  // lambda_L = -G_L^-1 (gamma_L' without contact forces).
  const Eigen::MatrixXd G = of_contacts(dynamics_.G(), flow_.locked_);
  const Eigen::MatrixXd G_inverse = l > 0 ? inverse(G) : G;
  for (Eigen::Index i = 0; i < l; ++i) {
    Functional lambda{Eigen::VectorXd::Zero(dynamics_.coordinates()),
                      Eigen::VectorXd::Zero(dynamics_.coordinates()), 0.0,
                      Eigen::VectorXcd::Zero(nh_),
                      Eigen::VectorXd::Zero(chain_terms * dynamics_.inputs().channels())};
    for (Eigen::Index j = 0; j < l; ++j) {
      const Functional a =
          dynamics_.free_acceleration(locked_contacts_[static_cast<std::size_t>(j)]);
      lambda.a -= G_inverse(i, j) * a.a;
      lambda.b -= G_inverse(i, j) * a.b;
      lambda.constant -= G_inverse(i, j) * a.constant;
      lambda.h -= G_inverse(i, j) * a.h;
      lambda.chain -= G_inverse(i, j) * a.chain;
    }
    flow_.force_[static_cast<std::size_t>(locked_contacts_[static_cast<std::size_t>(i)])] =
        flow_.signal(lambda);
  }
}

// gamma of a tied contact is the difference between the motion of its support and that of the
// supports in L. Terms at rounding level are set to zero, so that gamma is exactly zero if the
// supports move alike.
Signal Flow::Builder::tied_gap_velocity(int contact) const {
  constexpr double nothing = 1e-12;  // as a fraction of the terms
  const Functional gamma = dynamics_.gap_velocity(contact);
  Signal s = flow_.signal(gamma);
  const Eigen::VectorXd b = gamma.b.cwiseAbs();
  Eigen::VectorXd p = flow_.u_forced_.cos.cwiseAbs().transpose() * b;
  Eigen::VectorXd r = flow_.u_forced_.sin.cwiseAbs().transpose() * b;
  p.head(nh_) += gamma.h.real().cwiseAbs();
  r.head(nh_) += gamma.h.imag().cwiseAbs().cwiseQuotient(dynamics_.frequencies());
  for (Eigen::Index j = 0; 2 * j < gamma.chain.size(); ++j) {
    p[nh_ + j] += std::abs(gamma.chain[2 * j]);
    r[nh_ + j] += std::abs(gamma.chain[2 * j + 1]);
  }
  for (Eigen::Index j = 0; j < nf_; ++j) {
    if (std::abs(s.p[j]) <= nothing * p[j]) s.p[j] = 0.0;
    if (std::abs(s.r[j]) <= nothing * r[j]) s.r[j] = 0.0;
  }
  // gamma depends on the supports alone: shares of the modes' responses are rounding errors.
  if (sampled()) {
    s.p.segment(nf_ - dynamics_.coordinates(), dynamics_.coordinates()).setZero();
    s.r.segment(nf_ - dynamics_.coordinates(), dynamics_.coordinates()).setZero();
  }
  s.p.tail(flow_.size() - nf_).setZero();
  s.r.tail(flow_.size() - nf_).setZero();
  s.constant = 0.0;
  s.held.setZero();
  return s;
}

}  // namespace sprag
