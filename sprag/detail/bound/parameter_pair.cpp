#include "sprag/detail/bound/parameter_pair.h"

#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

void MotionDifference::resize(Eigen::Index f) {
  for (Eigen::VectorXd* x : {&z, &v, &acceleration, &jerk}) x->setZero(f);
}

double length(const EnergyMetric& metric, const MotionDifference& x) {
  return std::sqrt(0.5 * (metric.omega().cwiseProduct(x.z).squaredNorm() + x.v.squaredNorm()));
}

double second_rate(const EnergyMetric& metric, const MotionDifference& x) {
  return std::sqrt(
      0.5 * (metric.omega().cwiseProduct(x.acceleration).squaredNorm() + x.jerk.squaredNorm()));
}

ParameterPair::ParameterPair(const EnergyMetric& metric, ToleratedFactor factor, double limit)
    : metric_(&metric),
      factor_(factor),
      limit_(limit),
      rate_(limit *
            (factor == ToleratedFactor::stiffness ? metric.omega_max() : metric.damping())) {
  const Eigen::Index f = metric.coordinates();
  for (Eigen::VectorXd* x : {&q_, &u_, &z_, &v_, &scratch_}) x->setZero(f);
  xi_.resize(f);
  m_.resize(f);
  for (std::size_t k = 0; k < flows_.size(); ++k) {
    Model model = metric.dynamics().model();
    (factor == ToleratedFactor::stiffness ? model.K : model.C) *= 1.0 + (k == 0 ? limit : -limit);
    flows_[k] = std::make_unique<Flows>(std::move(model));
  }
  start(q_, u_, 0.0);
  for (std::size_t k = 0; k < flows_.size(); ++k) moved_[k] = motion_[k];
}

void ParameterPair::start(const Eigen::VectorXd& q, const Eigen::VectorXd& u, double t) {
  for (std::size_t k = 0; k < flows_.size(); ++k)
    (*flows_[k])[0].enter(q, u, at(t), no_gaps_, motion_[k]);
}

// Change of a motion's acceleration by the factor at its upper limit.
void ParameterPair::change(const Eigen::VectorXd& of_z, const Eigen::VectorXd& of_v,
                           Eigen::VectorXd& out) const {
  if (factor_ == ToleratedFactor::stiffness) {
    out = -limit_ * metric_->omega().cwiseAbs2().cwiseProduct(of_z);
  } else {
    metric_->damp(of_v, out);
    out *= -limit_;
  }
}

double ParameterPair::defect(const MotionDifference& x) {
  change(x.z, x.v, scratch_);
  return std::sqrt(0.5) * scratch_.norm();
}

void ParameterPair::look(double t, const ModalState& replica) {
  for (std::size_t k = 0; k < flows_.size(); ++k) {
    const Flow& flow = *motion_[k].flow;
    flow.propagate(motion_[k], at(t), moved_[k]);
    flow.state(moved_[k], q_, u_);
    metric_->displacements(q_, z_);
    metric_->displacements(u_, v_);
    if (k == 0) {
      xi_.z = m_.z = 0.5 * z_;
      xi_.v = m_.v = 0.5 * v_;
    } else {
      xi_.z -= 0.5 * z_;
      xi_.v -= 0.5 * v_;
      m_.z += 0.5 * z_;
      m_.v += 0.5 * v_;
    }
  }
  // v' = -D v - omega^2 z + change(x_s + m) for xi, + change(xi) for m; and the derivative of both.
  const auto free = [&](const Eigen::VectorXd& z, const Eigen::VectorXd& v, Eigen::VectorXd& out) {
    metric_->damp(v, scratch_);
    out -= scratch_ + metric_->omega().cwiseAbs2().cwiseProduct(z);
  };
  change(m_.z, m_.v, xi_.acceleration);  // x_s + m
  free(xi_.z, xi_.v, xi_.acceleration);
  m_.z -= replica.z;
  m_.v -= replica.v;
  change(xi_.z, xi_.v, m_.acceleration);
  free(m_.z, m_.v, m_.acceleration);
  z_ = replica.v + m_.v;
  v_ = replica.acceleration + m_.acceleration;
  change(z_, v_, xi_.jerk);
  free(xi_.v, xi_.acceleration, xi_.jerk);
  change(xi_.v, xi_.acceleration, m_.jerk);
  free(m_.v, m_.acceleration, m_.jerk);
}

void ParameterPair::impact(int contact, double epsilon, double t) {
  const Dynamics& dynamics = metric_->dynamics();
  for (std::size_t k = 0; k < flows_.size(); ++k) {
    const Flow& flow = *motion_[k].flow;
    flow.propagate(motion_[k], at(t), motion_[k]);
    flow.state(motion_[k], q_, u_);
    const double gamma = value(flow.gap_velocity(contact), motion_[k]);
    u_ -= (1.0 + epsilon) * gamma / dynamics.G()(contact, contact) * dynamics.MinvW().col(contact);
    flow.enter(q_, u_, at(t), no_gaps_, motion_[k]);
  }
}

}  // namespace sprag
