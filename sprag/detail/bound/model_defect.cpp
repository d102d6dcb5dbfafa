#include "sprag/detail/bound/model_defect.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

const double root_half = std::sqrt(0.5);
const double root_two = std::sqrt(2.0);

// Step as a share of 1 / |A|. The error of the trapezoidal rule is then some percent of the fastest
// mode's share.
constexpr double step_share = 0.4;

}  // namespace

ModelDefect::ModelDefect(const EnergyMetric& metric, const Tolerance& tolerance)
    : metric_(&metric),
      tolerance_(tolerance),
      any_(tolerance.stiffness > 0.0 || tolerance.damping > 0.0 || tolerance.force > 0.0),
      longest_step_(metric.rate() > 0.0 ? step_share / metric.rate() : infinity),
      lipschitz_(tolerance.stiffness * metric.omega_max() + tolerance.damping * metric.damping()) {
  const Eigen::VectorXd& Omega = metric.dynamics().frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const double amplitude = metric.force_amplitudes().col(j).norm();
    force_second_ += square(Omega[j]) * amplitude;
  }
  // In each interval f' changes by at most twice its largest value, and as much at the knot.
  for (Eigen::Index c = 0; c < metric.input_forces().cols(); ++c) {
    const SampledInput& input = metric.dynamics().inputs().channel(c);
    const double force = metric.input_forces().col(c).norm();
    double shortest = input.spacing();
    for (std::size_t k = 0; k + 1 < input.knots().size(); ++k) {
      shortest = std::min(shortest, input.knots()[k + 1] - input.knots()[k]);
    }
    if (force == 0.0) continue;
    sampled_jumps_ += 4.0 * force * input.largest(3);
    sampled_variation_ += 4.0 * force * input.largest(3) / shortest;
  }
  scratch_.setZero(metric.coordinates());
  jerk_.setZero(metric.coordinates());
}

DefectNode ModelDefect::node(const ModalState& state, double t, bool free) {
  const EnergyMetric& metric = *metric_;
  const auto stiffness = metric.omega().cwiseAbs2();
  DefectNode node;
  double sum = tolerance_.force;
  if (tolerance_.stiffness > 0.0) {
    sum += tolerance_.stiffness * stiffness.cwiseProduct(state.z).norm();
  }
  if (tolerance_.damping > 0.0) {
    metric.damp(state.v, scratch_);
    sum += tolerance_.damping * scratch_.norm();
  }
  node.density = root_half * sum;
  node.speed = speed(metric, state);
  if (!free) return node;
  metric.damp(state.acceleration, scratch_);
  jerk_ = -scratch_ - stiffness.cwiseProduct(state.v);
  const Eigen::VectorXd& Omega = metric.dynamics().frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const double c = Omega[j] * std::cos(Omega[j] * t);
    const double s = Omega[j] * std::sin(Omega[j] * t);
    jerk_ -=
        s * metric.force_amplitudes().col(j).real() + c * metric.force_amplitudes().col(j).imag();
  }
  for (Eigen::Index c = 0; c < metric.input_forces().cols(); ++c) {
    const SampledInput& input = metric.dynamics().inputs().channel(c);
    const std::size_t k = input.interval(t);
    jerk_ += input.derivatives(k, t - input.knots()[k])[3] * metric.input_forces().col(c);
  }
  node.acceleration =
      root_half * std::sqrt(metric.omega().cwiseProduct(state.acceleration).squaredNorm() +
                            jerk_.squaredNorm());
  node.Ka = stiffness.cwiseProduct(state.acceleration).norm();
  node.Cj = metric.damping() * jerk_.norm();
  return node;
}

double ModelDefect::free_step(const DefectNode& from, const DefectNode& to, double duration) const {
  const double trapezoid = 0.5 * duration * (from.density + to.density);
  if (lipschitz_ == 0.0) return trapezoid;
  // The rate of a sampled force jumps at knots, so that no second derivative bounds the curvature.
  if (metric_->input_forces().cols() > 0) return closed_step(from, duration);
  // |x''| grows by the forces alone, and |x'''| <= |A| |x''| + |f''| / sqrt 2.
  const double half = 0.5 * duration;
  const double second = from.acceleration + duration * root_half * force_second_;
  const double third = metric_->rate() * second + root_half * force_second_;
  const double omega = metric_->omega_max();
  const double K_curve = std::max(from.Ka, to.Ka) + half * square(omega) * root_two * second;
  const double C_curve = std::max(from.Cj, to.Cj) + half * metric_->damping() * root_two * third;
  const double curvature = tolerance_.stiffness * K_curve + tolerance_.damping * C_curve;
  return trapezoid + root_half * curvature * duration * duration * duration / 12.0;
}

double ModelDefect::closed_step(const DefectNode& from, double duration) const {
  const double fastest = from.speed + metric_->support_step() + duration * metric_->jerk();
  return duration * (from.density + 0.5 * duration * lipschitz_ * fastest);
}

}  // namespace sprag
