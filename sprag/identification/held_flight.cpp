#include "sprag/identification/held_flight.h"

#include <bit>
#include <complex>

#include "sprag/identification/coupled_step.h"
#include "sprag/mechanics/linear_algebra.h"
#include "sprag/mechanics/oscillators.h"

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

// What contact forces e^(i Omega t) along the columns of W move, n x h.
Eigen::MatrixXcd response_to(const Machine& machine, const Eigen::MatrixXd& W, double Omega) {
  const Eigen::Index n = machine.n(), h = W.cols();
  Eigen::MatrixXcd response(n, h);
  if (machine.modal) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const Complex Z(machine.K(k, 0) - Omega * Omega, Omega * machine.C(k, 0));
      for (Eigen::Index j = 0; j < h; ++j) response(k, j) = W(k, j) / Z;
    }
    return response;
  }
  MatrixR Z(2 * n, 2 * n), right = MatrixR::Zero(2 * n, h);
  Z.topLeftCorner(n, n) = machine.K.cast<Extended>();
  Z.topLeftCorner(n, n).diagonal().array() -= Omega * Omega;
  Z.bottomLeftCorner(n, n) = Omega * machine.C.cast<Extended>();
  Z.topRightCorner(n, n) = -Z.bottomLeftCorner(n, n);
  Z.bottomRightCorner(n, n) = Z.topLeftCorner(n, n);
  right.topRows(n) = W.cast<Extended>();
  const Eigen::MatrixXd parts = solve(Z, right).X.cast<double>();
  response.real() = parts.topRows(n);
  response.imag() = parts.bottomRows(n);
  return response;
}

// A^-1 b for the few contacts that are held.
Eigen::VectorXcd solve_complex(const Eigen::MatrixXcd& A, const Eigen::VectorXcd& b) {
  const Eigen::Index h = A.rows();
  MatrixR parts(2 * h, 2 * h), right(2 * h, 1);
  parts.topLeftCorner(h, h) = A.real().cast<Extended>();
  parts.bottomLeftCorner(h, h) = A.imag().cast<Extended>();
  parts.topRightCorner(h, h) = -parts.bottomLeftCorner(h, h);
  parts.bottomRightCorner(h, h) = parts.topLeftCorner(h, h);
  right.topRows(h) = b.real().cast<Extended>();
  right.bottomRows(h) = b.imag().cast<Extended>();
  const Eigen::MatrixXd x = solve(parts, right).X.cast<double>();
  Eigen::VectorXcd result(h);
  result.real() = x.topRows(h);
  result.imag() = x.bottomRows(h);
  return result;
}

}  // namespace

HeldFlight::HeldFlight(const Machine& machine, ContactSet held) : held_(held) {
  const Eigen::Index n = machine.n(), h = std::popcount(held), r = n - h;
  const Eigen::MatrixXd W = columns_of(machine, held);
  const Eigen::MatrixXd Q = QR(W).Q_times(Eigen::MatrixXd::Identity(n, n));
  fixed_ = Q.leftCols(h);
  N_ = Q.rightCols(r);
  const Eigen::MatrixXd K = full(machine.K, machine.modal), C = full(machine.C, machine.modal);
  const auto onto = [&](const Eigen::MatrixXd& A) -> Eigen::MatrixXd {
    return N_.transpose() * A * N_;
  };
  if (r > 0) N_ *= eigenpairs(onto(K), Eigen::MatrixXd::Identity(r, r)).vectors;
  K_ = onto(K);
  C_ = onto(C);
  modal_ = is_nearly_diagonal(C_);
  if (modal_) {
    K_ = K_.diagonal().cwiseMax(0.0).eval();
    C_ = C_.diagonal().eval();
  }
  forces_ = N_.transpose() * machine.constant_forces;
  pull_ = -(N_.transpose() * K * fixed_);
  push_ = -(W * inverse(Eigen::MatrixXd(W.transpose() * W)));
  offset_.resize(n, machine.groups());
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Eigen::MatrixXcd response = response_to(machine, W, machine.frequencies[g]);
    Eigen::VectorXcd gaps(h);
    Eigen::Index j = 0;
    for_each(held, [&](int i) { gaps[j++] = machine.gap_response(i, g); });
    offset_.col(g) = response * solve_complex(W.transpose() * response, gaps);
  }
}

void HeldFlight::move(double tau, const Eigen::MatrixXd& constants, Eigen::MatrixXd& Y,
                      Eigen::MatrixXd& U) const {
  const Eigen::Index r = N_.cols(), J = forces_.cols(), h = fixed_.cols();
  const Eigen::MatrixXd p = fixed_.transpose() * Y;
  Eigen::MatrixXd s = N_.transpose() * Y, v = N_.transpose() * U;
  if (modal_) {
    Eigen::MatrixXd alpha = pull_ * p;
    if (J > 0) alpha += forces_ * constants;
    for (Eigen::Index i = 0; i < r; ++i) {
      const OscillatorStep step = oscillator_step(0.5 * C_(i, 0), K_(i, 0), tau);
      for (Eigen::Index j = 0; j < s.cols(); ++j) step.apply(alpha(i, j), s(i, j), v(i, j));
    }
  } else {
    Eigen::MatrixXd forces(r, J + h), x(2 * r + J + h, Y.cols());
    forces << forces_, pull_;
    x << s, v, constants, p;
    const Eigen::MatrixXd moved = coupled_step(C_, K_, forces, tau) * x;
    s = moved.topRows(r);
    v = moved.bottomRows(r);
  }
  Y = fixed_ * p + N_ * s;
  U = N_ * v;
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
    direction -= W * PivotedQR(W, 1e-12).solve(w);
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
