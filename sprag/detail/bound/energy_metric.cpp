#include "sprag/detail/bound/energy_metric.h"

#include <cmath>
#include <complex>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

EnergyMetric::EnergyMetric(const Dynamics& dynamics) : dynamics_(&dynamics) {
  const Model& model = dynamics.model();
  const NaturalModes modes = natural_modes(model);
  const Eigen::VectorXd root = modes.mass.cwiseSqrt();
  of_coordinates_ = modes.of_coordinates;
  from_modes_ = modes.Phi * root.cwiseInverse().asDiagonal();
  to_modes_ = product(from_modes_.transpose(), model.M);
  omega_ = modes.stiffness.cwiseQuotient(modes.mass).cwiseSqrt();
  D_ = congruent(from_modes_, model.C);
  D_ = (0.5 * (D_ + D_.transpose())).eval();
  omega_max_ = omega_.maxCoeff();
  damping_ = eigenvalues(D_).cwiseAbs().maxCoeff();
  Eigen::MatrixXd coupling = D_;
  coupling.diagonal().setZero();
  decoupled_ = coupling.cwiseAbs().maxCoeff() <= share_of_rounding * damping_;
  if (decoupled_) damping_ += coupling.cwiseAbs().rowwise().sum().maxCoeff();
  W_ = product(from_modes_.transpose(), dynamics.W());

  const Eigen::Index m = dynamics.contacts();
  omega_R_.resize(m);
  omega_D_.resize(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const double length = W_.col(i).norm();
    omega_R_[i] = omega_.cwiseProduct(W_.col(i)).norm() / length;
    omega_D_[i] = (D_ * W_.col(i)).norm() / length;
  }
  omega_gamma_ = (omega_R_.array().square() + omega_D_.array().square()).sqrt();

  force_constant_ = from_modes_.transpose() * dynamics.force_constant();
  force_amplitudes_.resize(omega_.size(), dynamics.force_amplitudes().cols());
  force_amplitudes_.real() = product(from_modes_.transpose(), dynamics.force_amplitudes().real());
  force_amplitudes_.imag() = product(from_modes_.transpose(), dynamics.force_amplitudes().imag());
  const Eigen::VectorXd& Omega = dynamics.frequencies();
  gap_jerk_.setZero(m);
  push_ = force_constant_.norm() / std::sqrt(2.0);
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    push_ += force_amplitudes_.col(j).norm() / std::sqrt(2.0);
    jerk_ += Omega[j] * force_amplitudes_.col(j).norm() / std::sqrt(2.0);
    for (Eigen::Index i = 0; i < m; ++i) {
      const double of_normal = 1.0 / std::sqrt(2.0 * dynamics.G()(i, i));
      const double velocity = std::abs(dynamics.motion_amplitudes()(i, j)) * Omega[j];
      jerk_ += velocity * of_normal *
               (square(Omega[j]) + omega_D_[i] * Omega[j] + omega_max_ * omega_R_[i]);
      support_step_ += 2.0 * velocity * Omega[j] * of_normal;
      gap_jerk_[i] +=
          velocity * square(Omega[j]) +
          Omega[j] * std::abs(W_.col(i).cast<std::complex<double>>().dot(force_amplitudes_.col(j)));
    }
  }
  const SampledInputs& inputs = dynamics.inputs();
  input_forces_ = product(from_modes_.transpose(), inputs.forces());
  for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
    const SampledInput& input = inputs.channel(c);
    const double force = input_forces_.col(c).norm() / std::sqrt(2.0);
    if (force > 0.0) {
      push_ += force * input.largest(2);
      jerk_ += force * input.largest(3);
    }
    for (Eigen::Index i = 0; i < m; ++i) {
      gap_jerk_[i] += std::abs(W_.col(i).dot(input_forces_.col(c))) * input.largest(3);
      const double share = std::abs(inputs.motions()(i, c));
      if (share == 0.0) continue;
      const double of_normal = share / std::sqrt(2.0 * dynamics.G()(i, i));
      jerk_ += of_normal * (input.largest(3) + omega_D_[i] * input.largest(2) +
                            omega_max_ * omega_R_[i] * input.largest(1));
      support_step_ += 2.0 * of_normal * input.largest(2);
      gap_jerk_[i] += share * input.largest(3);
    }
  }
}

void EnergyMetric::displacements(const Eigen::VectorXd& q, Eigen::VectorXd& z) const {
  if (of_coordinates_) {
    z = to_modes_.diagonal().cwiseProduct(q);
  } else {
    z.noalias() = to_modes_ * q;
  }
}

void EnergyMetric::enter(const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                         ModalState& state) const {
  displacements(q, state.z);
  displacements(u, state.v);
}

void EnergyMetric::damp(const Eigen::Ref<const Eigen::VectorXd>& v, Eigen::VectorXd& Dv) const {
  if (decoupled_) {
    Dv = D_.diagonal().cwiseProduct(v);
  } else {
    Dv.noalias() = D_ * v;
  }
}

void EnergyMetric::accelerate(const Motion& motion, ModalState& state) const {
  const double t = motion.t.hi;
  Eigen::VectorXd& a = state.acceleration;
  damp(state.v, a);
  a = force_constant_ - a - omega_.cwiseAbs2().cwiseProduct(state.z);
  const Eigen::VectorXd& Omega = dynamics_->frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const double c = std::cos(Omega[j] * t);
    const double s = std::sin(Omega[j] * t);
    a += c * force_amplitudes_.col(j).real() - s * force_amplitudes_.col(j).imag();
  }
  for (Eigen::Index c = 0; c < input_forces_.cols(); ++c) {
    a += dynamics_->inputs().channel(c).value(t) * input_forces_.col(c);
  }
  for_each(motion.flow->locked(),
           [&](int i) { a += value(motion.flow->force(i), motion) * W_.col(i); });
}

double energy(const EnergyMetric& metric, const ModalState& state) {
  return 0.5 * (metric.omega().cwiseProduct(state.z).squaredNorm() + state.v.squaredNorm());
}

double speed(const EnergyMetric& metric, const ModalState& state) {
  return std::sqrt(0.5 * (metric.omega().cwiseProduct(state.v).squaredNorm() +
                          state.acceleration.squaredNorm()));
}

}  // namespace sprag
