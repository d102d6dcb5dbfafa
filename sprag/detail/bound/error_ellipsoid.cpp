#include "sprag/detail/bound/error_ellipsoid.h"

#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {
namespace {

// The radius is computed from P^(2^4): at most n^(1/32) times too large.
constexpr int squarings = 4;

}  // namespace

ErrorEllipsoid::ErrorEllipsoid(const EnergyMetric& metric, const Flow& free)
    : metric_(&metric), free_(&free) {
  const Eigen::Index f = metric.coordinates();
  const Eigen::Index n = 2 * f;
  const double root_two = std::sqrt(2.0);
  // Rigid motions have no displacement component in x.
  const Eigen::VectorXd& omega = metric.omega();
  const Eigen::VectorXd inverse = (omega.array() > 0.0).select(omega.cwiseInverse(), 0.0);
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(f, n);
  Eigen::MatrixXd u = q;
  q.leftCols(f) = root_two * metric.from_modes() * inverse.asDiagonal();
  u.rightCols(f) = root_two * metric.from_modes();
  enter_.setZero(n, n);
  free.enter_differences(q, u, enter_.topRows(f), enter_.bottomRows(f));
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(n, n);
  free.state_differences(unit.topRows(f), unit.bottomRows(f), q, u);
  leave_.setZero(n, n);
  leave_ << omega.asDiagonal() * product(metric.to_modes(), q), product(metric.to_modes(), u);
  leave_ /= root_two;
  kernels_.resize(free.size());
  P_.setZero(n, n);
  moved_ = Phi_ = scratch_ = P_;
  column_.setZero(n);
}

void ErrorEllipsoid::clear() {
  is_point_ = true;
  radius_ = 0.0;
  P_.setZero();
}

void ErrorEllipsoid::fly(double tau) {
  if (is_point_ || !(tau > 0.0)) return;
  const Eigen::Index f = metric_->coordinates();
  const Eigen::Index first = free_->frequencies();
  free_->oscillators().kernels(tau, first, f, kernels_);
  for (Eigen::Index i = 0; i < f; ++i) {
    const Eigen::Index k = first + i;
    moved_.row(i) = kernels_.zz[k] * enter_.row(i) + kernels_.zv[k] * enter_.row(f + i);
    moved_.row(f + i) = kernels_.vz[k] * enter_.row(i) + kernels_.vv[k] * enter_.row(f + i);
  }
  multiply(leave_, moved_, Phi_);
  multiply(Phi_, P_, scratch_);
  moved_ = scratch_.transpose();
  multiply(Phi_, moved_, P_);
  P_ *= 1.0 + share_of_rounding;
}

void ErrorEllipsoid::impact(int contact, double epsilon) {
  if (is_point_) return;
  const Eigen::Index f = metric_->coordinates();
  const auto w = metric_->W().col(contact);
  const double share = (1.0 + epsilon) / w.squaredNorm();
  // H P H^T with H = I - share (0, w) (0, w)^T.
  column_.noalias() = P_.rightCols(f) * w;
  P_.rightCols(f).noalias() -= share * column_ * w.transpose();
  column_.noalias() = P_.bottomRows(f).transpose() * w;
  P_.bottomRows(f).noalias() -= share * w * column_.transpose();
  P_ *= 1.0 + share_of_rounding;
}

void ErrorEllipsoid::add(const Eigen::VectorXd& v) {
  const double length = v.norm();
  if (!(length > 0.0)) return;
  const double size = std::sqrt(std::max(P_.trace(), 0.0));
  if (is_point_ || !(size > 0.0)) {
    P_.noalias() = v * v.transpose();
  } else {
    P_ *= 1.0 + length / size;
    P_.noalias() += (1.0 + size / length) * v * v.transpose();
  }
  is_point_ = false;
}

// The largest eigenvalue of P is at most the k-th root of the trace of P^k. Repeated squaring gives
// P^k.
void ErrorEllipsoid::update_radius() {
  double root = 1.0;
  double value = 1.0;
  moved_ = P_;
  for (int i = 0; i < squarings; ++i) {
    const double trace = moved_.trace();
    if (!(trace > 0.0)) {
      radius_ = 0.0;
      return;
    }
    value *= std::pow(trace, root);
    moved_ /= trace;
    multiply(moved_, moved_, scratch_);
    moved_.swap(scratch_);
    root *= 0.5;
  }
  value *= std::pow(std::max(moved_.trace(), 0.0), root);
  radius_ = std::sqrt(value) * (1.0 + share_of_rounding);
}

double ErrorEllipsoid::largest_gap_velocity(int contact) const {
  if (is_point_) return 0.0;
  const Eigen::Index f = metric_->coordinates();
  const auto w = metric_->W().col(contact);
  double sum = 0.0;
  for (Eigen::Index j = 0; j < f; ++j) sum += w[j] * w.dot(P_.col(f + j).tail(f));
  return std::sqrt(2.0 * std::max(sum, 0.0));  // gamma = w^T v, v = sqrt 2 times its part of x
}

}  // namespace sprag
