#include "studies/work_precision/machine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

namespace sprag::work_precision {
namespace {

bool is_diagonal(const Eigen::MatrixXd& A) { return A.isDiagonal(0.0); }

using Map = Eigen::Map<const Eigen::VectorXd>;

}  // namespace

Machine::Machine(const Model& model)
    : model_(model),
      diagonal_(is_diagonal(model.M) && is_diagonal(model.C) && is_diagonal(model.K)) {
  const Eigen::LLT<Eigen::MatrixXd> factor(model.M);
  if (factor.info() != Eigen::Success) throw ModelError("M must be positive definite");
  W_.resize(f(), m());
  for (int i = 0; i < m(); ++i) W_.col(i) = model.contacts[static_cast<std::size_t>(i)].w;
  MinvW_ = factor.solve(W_);
  G_ = W_.transpose() * MinvW_;
  constant_ = Eigen::VectorXd::Zero(f());
  for (const Force& force : model.forces) {
    constant_ += force.direction * force.constant;
    const Harmonic& harmonic = force.harmonic;
    if (harmonic.amplitude == 0.0) continue;
    const auto known = std::find_if(drives_.begin(), drives_.end(), [&](const Drive& drive) {
      return drive.frequency == harmonic.frequency && drive.phase == harmonic.phase;
    });
    if (known != drives_.end()) {
      known->force += force.direction * harmonic.amplitude;
    } else {
      drives_.push_back({harmonic.frequency, harmonic.phase, force.direction * harmonic.amplitude,
                         Eigen::VectorXd()});
    }
  }
  for (Drive& drive : drives_) drive.acceleration = factor.solve(drive.force);
  if (diagonal_) {
    const Eigen::VectorXd minv = model.M.diagonal().cwiseInverse();
    constant_acceleration_ = minv.cwiseProduct(constant_);
    c_over_m_ = model.C.diagonal().cwiseProduct(minv);
    k_over_m_ = model.K.diagonal().cwiseProduct(minv);
  } else {
    Minv_ = factor.solve(Eigen::MatrixXd::Identity(f(), f()));
  }
  scratch_.resize(f());
}

void Machine::force(double t, Eigen::VectorXd& f) const {
  f = constant_;
  for (const Drive& drive : drives_) {
    f += std::cos(drive.frequency * t + drive.phase) * drive.force;
  }
}

void Machine::accelerate(double t, const double* q, const double* u, double* a) const {
  const Eigen::Index n = f();
  if (diagonal_) {
    // Plain loops: for a few coordinates the overhead of Eigen's dynamic sizes exceeds the
    // arithmetic.
    const double* constant = constant_acceleration_.data();
    const double* c = c_over_m_.data();
    const double* k = k_over_m_.data();
    for (Eigen::Index i = 0; i < n; ++i) a[i] = constant[i] - c[i] * u[i] - k[i] * q[i];
    for (const Drive& drive : drives_) {
      const double cosine = std::cos(drive.frequency * t + drive.phase);
      const double* amplitude = drive.acceleration.data();
      for (Eigen::Index i = 0; i < n; ++i) a[i] += cosine * amplitude[i];
    }
    return;
  }
  force(t, scratch_);
  scratch_.noalias() -= model_.C * Map(u, n);
  scratch_.noalias() -= model_.K * Map(q, n);
  Eigen::Map<Eigen::VectorXd>(a, n).noalias() = Minv_ * scratch_;
}

bool Machine::accelerate_locked(double t, const double* q, const double* u, ContactSet locked,
                                double* a, ContactVector& lambda) const {
  accelerate(t, q, u, a);
  const int n = std::popcount(locked);
  Eigen::Map<Eigen::VectorXd> acceleration(a, f());
  if (n == 1) {
    const int i = std::countr_zero(locked);
    lambda.resize(1);
    lambda[0] = -(W_.col(i).dot(acceleration) + support_acceleration(i, t)) / G_(i, i);
    acceleration += lambda[0] * MinvW_.col(i);
    return true;
  }
  ContactVector rate(n);
  Eigen::Index row = 0;
  for_each(locked, [&](int i) {
    rate[row] = W_.col(i).dot(acceleration) + support_acceleration(i, t);
    ++row;
  });
  if (arrest(of_contacts(G_, locked), rate, lambda) != Solved::yes) return false;
  row = 0;
  for_each(locked, [&](int i) { acceleration += lambda[row++] * MinvW_.col(i); });
  return true;
}

double Machine::gap(int contact, double t, const double* q) const {
  const Contact& c = model_.contacts[static_cast<std::size_t>(contact)];
  const double* w = c.w.data();
  double g = c.clearance;
  if (c.motion.amplitude != 0.0) g += value(c.motion, t);
  for (Eigen::Index i = 0; i < f(); ++i) g += w[i] * q[i];
  return g;
}

double Machine::gap_velocity(int contact, double t, const double* u) const {
  const Contact& c = model_.contacts[static_cast<std::size_t>(contact)];
  const double* w = c.w.data();
  double gamma = c.motion.amplitude != 0.0 ? rate(c.motion, t) : 0.0;
  for (Eigen::Index i = 0; i < f(); ++i) gamma += w[i] * u[i];
  return gamma;
}

double Machine::support_acceleration(int contact, double t) const {
  const Harmonic& motion = model_.contacts[static_cast<std::size_t>(contact)].motion;
  return -motion.frequency * motion.frequency * value(motion, t);
}

bool Machine::impact(double t, ContactSet closed, const std::vector<double>& epsilon,
                     double* u) const {
  const int n = std::popcount(closed);
  ContactVector gamma(n), epsilon_A(n), Lambda, gamma_plus;
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    gamma[row] = gap_velocity(i, t, u);
    epsilon_A[row] = epsilon[static_cast<std::size_t>(i)];
    ++row;
  });
  if (sprag::impact(model_.law, of_contacts(G_, closed), epsilon_A, gamma, Lambda, gamma_plus) !=
      Solved::yes) {
    return false;
  }
  row = 0;
  Eigen::Map<Eigen::VectorXd> velocity(u, f());
  for_each(closed, [&](int i) { velocity += Lambda[row++] * MinvW_.col(i); });
  return true;
}

}  // namespace sprag::work_precision
