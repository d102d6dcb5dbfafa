#include "tests/support/reference_motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace sprag {

ReferenceMotion::ReferenceMotion(const Model& model, const std::vector<int>& locked,
                                 const State& start, Real t)
    : model_(model), locked_(locked), t_(t) {
  const Eigen::Index f = model.coordinates();
  const auto l = static_cast<Eigen::Index>(locked.size());
  // [M -W; W^T 0] [u'; lambda] = [f - C u - K q; -s'']
  kkt_.setZero(f + l, f + l);
  kkt_.topLeftCorner(f, f) = model.M.cast<Real>();
  for (Eigen::Index i = 0; i < l; ++i) {
    const Vector w = contact(i).w.cast<Real>();
    kkt_.col(f + i).head(f) = -w;
    kkt_.row(f + i).head(f) = w.transpose();
  }
  inverse_ = kkt_.fullPivLu().inverse();
  C_ = model.C.cast<Real>();
  K_ = model.K.cast<Real>();
  q_ = start.q.cast<Real>();
  u_ = start.u.cast<Real>();
  Real rate = 1;
  for (const Force& force : model.forces) rate = std::max(rate, Real(force.harmonic.frequency));
  for (const Contact& c : model.contacts) rate = std::max(rate, Real(c.motion.frequency));
  const Matrix S = inverse_.topLeftCorner(f, f);
  longest_ = 0.5L / std::max({rate, (S * C_).norm(), std::sqrt((S * K_).norm())});
}

void ReferenceMotion::advance(Real tau) {
  const auto steps = static_cast<int>(std::ceil(tau / longest_));
  const Real start = t_;
  for (int k = 1; k <= steps; ++k) {
    step(tau / static_cast<Real>(steps));
    t_ = start + tau * static_cast<Real>(k) / static_cast<Real>(steps);
  }
}

ReferenceMotion::Vector ReferenceMotion::lambda() const {
  return solve(derivative(0) - C_ * u_ - K_ * q_, 0).tail(contacts());
}

const Contact& ReferenceMotion::contact(Eigen::Index i) const {
  return model_.contacts[static_cast<std::size_t>(locked_[static_cast<std::size_t>(i)])];
}

// k-th derivative of a cos(Omega t + phi) at t_.
ReferenceMotion::Real ReferenceMotion::derivative(const Harmonic& harmonic, int k) const {
  const Real Omega = harmonic.frequency;
  const Real phase = Omega * t_ + harmonic.phase;
  const Real size = harmonic.amplitude * std::pow(Omega, static_cast<Real>(k));
  switch (k % 4) {
    case 0:
      return size * std::cos(phase);
    case 1:
      return -size * std::sin(phase);
    case 2:
      return -size * std::cos(phase);
    default:
      return size * std::sin(phase);
  }
}

// k-th derivative of f(t).
ReferenceMotion::Vector ReferenceMotion::derivative(int k) const {
  Vector sum = Vector::Zero(model_.coordinates());
  for (const Force& force : model_.forces) {
    const Real constant = k == 0 ? Real(force.constant) : Real(0);
    sum += force.direction.cast<Real>() * (constant + derivative(force.harmonic, k));
  }
  return sum;
}

// k-th derivatives of u' and lambda.
ReferenceMotion::Vector ReferenceMotion::solve(const Vector& force, int k) const {
  Vector right(force.size() + contacts());
  right.head(force.size()) = force;
  for (Eigen::Index i = 0; i < contacts(); ++i) {
    right[force.size() + i] = -derivative(contact(i).motion, k + 2);
  }
  return inverse_ * right;
}

void ReferenceMotion::step(Real h) {
  Vector q_k = q_;  // k-th derivatives
  Vector u_k = u_;
  Real power = 1;  // h^k / k!
  for (int k = 0; k < 30; ++k) {
    const Vector next = solve(derivative(k) - C_ * u_k - K_ * q_k, k).head(q_.size());
    power *= h / static_cast<Real>(k + 1);
    q_ += power * u_k;
    u_ += power * next;
    q_k = u_k;
    u_k = next;
  }
}

}  // namespace sprag
