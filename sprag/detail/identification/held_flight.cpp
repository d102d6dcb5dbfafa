#include "sprag/detail/identification/held_flight.h"

#include <bit>
#include <complex>

#include "sprag/detail/identification/coupled_step.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {
namespace {

using Complex = std::complex<double>;

Eigen::MatrixXd columns_of(const Machine& machine, ContactSet contacts) {
  Eigen::MatrixXd W(machine.n(), std::popcount(contacts));
  Eigen::Index j = 0;
  for_each(contacts, [&](int i) { W.col(j++) = machine.W.col(i); });
  return W;
}

Eigen::MatrixXd full(const Eigen::MatrixXd& A, bool modal) {
  return modal ? Eigen::MatrixXd(A.col(0).asDiagonal()) : A;
}

}  // namespace

HeldFlight::HeldFlight(const Machine& machine, ContactSet held)
    : held_(held), frequencies_(machine.frequencies) {
  if (machine.records() > 0) {
    throw ModelError("a motion with held contacts is not supported under a recorded input");
  }
  const Eigen::Index n = machine.n(), h = std::popcount(held), r = n - h;
  const Eigen::MatrixXd W = columns_of(machine, held);
  const Eigen::MatrixXd Q = QR(W).Q_times(Eigen::MatrixXd::Identity(n, n));
  fixed_ = Q.leftCols(h);
  N_ = Q.rightCols(r);
  const Eigen::MatrixXd K = full(machine.K, machine.modal), C = full(machine.C, machine.modal);
  if (r > 0) {
    N_ = product(N_, eigenpairs(congruent(N_, K), Eigen::MatrixXd::Identity(r, r)).vectors);
  }
  K_ = congruent(N_, K);
  C_ = congruent(N_, C);
  modal_ = is_nearly_diagonal(C_);
  if (modal_) {
    K_ = K_.diagonal().cwiseMax(0.0).eval();
    C_ = C_.diagonal().eval();
  }
  forces_ = product(N_.transpose(), machine.constant_forces);
  pull_ = -product(N_.transpose(), product(K, fixed_));
  push_ = -product(W, inverse(product(W.transpose(), W)));
  offset_.resize(n, machine.groups());
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    Eigen::MatrixXcd response = W.cast<Complex>();
    set_steady_response(machine, machine.frequencies[g], response);
    VectorCR gaps(h);
    Eigen::Index j = 0;
    for_each(held, [&](int i) { gaps[j++] = machine.gap_response(i, g); });
    const MatrixCR of_gaps = W.transpose().lazyProduct(response).cast<std::complex<Extended>>();
    const Eigen::VectorXcd forces = solve(of_gaps, MatrixCR(gaps)).col(0).cast<Complex>();
    offset_.col(g) = response.lazyProduct(forces);
  }
}

Eigen::MatrixXd HeldFlight::offset(double t) const {
  const Eigen::Index n = offset_.rows();
  Eigen::MatrixXd x(2 * n, 2 * offset_.cols());
  for (Eigen::Index g = 0; g < offset_.cols(); ++g) {
    const double Omega = frequencies_[g];
    const Eigen::VectorXcd y = std::polar(1.0, Omega * t) * offset_.col(g);
    x.col(2 * g) << y.real(), -Omega * y.imag();
    x.col(2 * g + 1) << -y.imag(), -Omega * y.real();
  }
  return x;
}

void HeldFlight::move(double t, double tau, const Eigen::MatrixXd& inputs, Eigen::MatrixXd& Y,
                      Eigen::MatrixXd& U) const {
  const Eigen::Index n = Y.rows(), r = N_.cols(), J = forces_.cols(), h = fixed_.cols();
  const auto harmonics = inputs.topRows(2 * offset_.cols());
  const auto constants = inputs.bottomRows(J);
  const Eigen::MatrixXd before = product(offset(t), harmonics);
  Y += before.topRows(n);
  U += before.bottomRows(n);
  const Eigen::MatrixXd p = product(fixed_.transpose(), Y);
  Eigen::MatrixXd s = product(N_.transpose(), Y), v = product(N_.transpose(), U);
  if (modal_) {
    Eigen::MatrixXd alpha = product(pull_, p);
    if (J > 0) alpha += product(forces_, constants);
    for (Eigen::Index i = 0; i < r; ++i) {
      const OscillatorStep step = oscillator_step(0.5 * C_(i, 0), K_(i, 0), tau);
      for (Eigen::Index j = 0; j < s.cols(); ++j) step.apply(alpha(i, j), s(i, j), v(i, j));
    }
  } else {
    Eigen::MatrixXd forces(r, J + h), x(2 * r + J + h, Y.cols());
    forces << forces_, pull_;
    x << s, v, constants, p;
    const Eigen::MatrixXd moved = product(coupled_step(C_, K_, forces, tau), x);
    s = moved.topRows(r);
    v = moved.bottomRows(r);
  }
  const Eigen::MatrixXd forced = product(offset(t + tau), harmonics);
  Y = product(fixed_, p) + product(N_, s) - forced.topRows(n);
  U = product(N_, v) - forced.bottomRows(n);
}

Eigen::VectorXd HeldFlight::force(const Eigen::VectorXd& free_rates) const {
  Eigen::VectorXd of_held(push_.cols());
  Eigen::Index j = 0;
  for_each(held_, [&](int i) { of_held[j++] = free_rates[i]; });
  return push_ * of_held;
}

Eigen::VectorXd jump_of(const Machine& machine, int contact, ContactSet staying) {
  if (staying == 0) return machine.jump.col(contact);
  const auto w = machine.W.col(contact);
  const bool stays = contains(staying, contact);
  const ContactSet others = staying & ~bit(contact);
  const double epsilon = stays ? 0.0 : w.dot(machine.jump.col(contact)) - 1.0;
  Eigen::VectorXd direction = w;
  if (others != 0) {
    const Eigen::MatrixXd W = columns_of(machine, others);
    direction -= product(W, PivotedQR(W, 1e-12).solve(w));
  }
  return direction * ((1.0 + epsilon) / w.dot(direction));
}

bool are_independent(const Machine& machine, ContactSet contacts) {
  constexpr double dependent = 1e-9;
  const Eigen::Index h = std::popcount(contacts);
  return h <= machine.n() && PivotedQR(columns_of(machine, contacts), dependent).rank() == h;
}

bool is_one_impact(const Machine& machine, int contact, ContactSet held, ContactSet staying) {
  if (!are_independent(machine, held | staying | bit(contact))) return false;
  const Eigen::VectorXd jump = jump_of(machine, contact, staying);
  bool one = true;
  for_each(held & ~staying, [&](int i) {
    if (!(machine.W.col(i).dot(jump) > 0.0)) one = false;
  });
  return one;
}

}  // namespace sprag
