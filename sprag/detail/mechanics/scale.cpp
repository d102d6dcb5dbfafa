#include "sprag/detail/mechanics/scale.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/energy.h"

namespace sprag {
namespace {

double largest_row_sum(const Eigen::MatrixXd& A) { return A.cwiseAbs().rowwise().sum().maxCoeff(); }

// Time until a gap of this size closes at constant acceleration; zero if nothing moves.
double flight(double gap, double velocity, double acceleration) {
  const double g = std::abs(gap);
  const double v = std::abs(velocity);
  const double a = std::abs(acceleration);
  if (a > 0.0) return (v + std::sqrt(v * v + 2.0 * a * g)) / a;
  return v > 0.0 ? g / v : 0.0;
}

// Energy of the steady response of a mode phi with mass m and stiffness k to a force. The mode
// counts as damped by at least 1 % of critical. `length` bounds the fall of a rigid motion.
double energy_of_answer(const Force& force, const Eigen::VectorXd& phi, double c, double m,
                        double k, double length) {
  constexpr double least_damping = 0.01;
  const double share = phi.dot(force.direction);
  const Harmonic& harmonic = force.harmonic;
  const bool is_steady = harmonic.frequency == 0.0;
  const double constant = share * (force.constant + (is_steady ? value(harmonic, 0.0) : 0.0));
  double energy = k > 0.0 ? 0.5 * square(constant) / k
                          : std::abs(constant) * length / phi.cwiseAbs().maxCoeff();
  if (!is_steady) {
    const double inertia = m * square(harmonic.frequency);
    const double stiffest = std::max(k, inertia);
    const double of_motion =
        std::max(std::hypot(k - inertia, c * harmonic.frequency), 2.0 * least_damping * stiffest);
    energy += 0.5 * stiffest * square(share * harmonic.amplitude / of_motion);
  }
  return energy;
}

// Typical frequency of a sampled input [rad per unit of time].
double frequency_of(const SampledInput& input) {
  return input.largest(2) > 0.0 ? input.largest(3) / input.largest(2) : 0.0;
}

// The same for a sampled force, as a harmonic of the same rms. The record may excite resonances.
double energy_of_sampled_answer(const Force& force, const Eigen::VectorXd& phi, double m,
                                double k) {
  constexpr double response = 0.1;
  const double stiffest = std::max(k, m * square(frequency_of(*force.input)));
  if (stiffest == 0.0) return 0.0;
  const double share = phi.dot(force.direction) * std::sqrt(2.0) * force.input->rms();
  return 0.5 * square(share / response) / stiffest;
}

}  // namespace

double length_scale(const Model& model, const State& start) {
  double length = start.q.cwiseAbs().maxCoeff();
  for (const Contact& contact : model.contacts) {
    length = std::max({length, std::abs(contact.clearance), std::abs(contact.motion.amplitude)});
    if (contact.input && contact.input->settings().displacement) {
      length = std::max(length, std::abs(contact.input_share) * contact.input->largest(0));
    }
  }
  return length > 0.0 ? length : 1.0;
}

double energy_scale(const Model& model, const State& start) {
  const NaturalModes modes = natural_modes(model);
  const double length = length_scale(model, start);
  double energy = 0.5 * start.u.dot(model.M * start.u) + 0.5 * start.q.dot(model.K * start.q);
  for (Eigen::Index i = 0; i < modes.mass.size(); ++i) {
    const Eigen::VectorXd phi = modes.Phi.col(i);
    const double c = phi.dot(model.C * phi);
    for (const Force& force : model.forces) {
      energy += energy_of_answer(force, phi, c, modes.mass[i], modes.stiffness[i], length);
      if (force.input) {
        energy += energy_of_sampled_answer(force, phi, modes.mass[i], modes.stiffness[i]);
      }
    }
  }
  for (const Contact& contact : model.contacts) {
    // 1/G and the stiffness at the contact, by modes; that of a rigid motion is 0.
    const Eigen::ArrayXd of_modes = (modes.Phi.transpose() * contact.w).array().square();
    const double mass = 1.0 / (of_modes / modes.mass.array()).sum();
    double compliance = 0.0;
    for (Eigen::Index i = 0; i < of_modes.size(); ++i) {
      if (of_modes[i] > 0.0) compliance += of_modes[i] / modes.stiffness[i];
    }
    const Harmonic& motion = contact.motion;
    energy += 0.5 * mass * square(motion.amplitude * motion.frequency) +
              0.5 * square(contact.clearance) / compliance;
  }
  return energy;
}

double time_scale(const Model& model, const State& start) {
  constexpr double some_periods = 64.0;  // in radians
  const Eigen::MatrixXd M_inverse = inverse(model.M);
  // Upper bounds of the largest frequency squared and of the fastest decay.
  double fastest = std::sqrt(largest_row_sum(product(M_inverse, model.K)));
  fastest = std::max(fastest, largest_row_sum(product(M_inverse, model.C)));

  Eigen::VectorXd force = -(model.C * start.u) - model.K * start.q;
  const auto oscillates = [](const Harmonic& harmonic) { return harmonic.amplitude != 0.0; };
  for (const Force& f : model.forces) {
    force += f.direction * (f.constant + value(f.harmonic, 0.0));
    if (oscillates(f.harmonic)) fastest = std::max(fastest, f.harmonic.frequency);
    if (f.input) {
      force += f.direction * f.input->value(0.0);
      fastest = std::max(fastest, frequency_of(*f.input));
    }
  }
  const Eigen::VectorXd acceleration = M_inverse * force;
  double slowest = 0.0;
  for (const Contact& contact : model.contacts) {
    const Harmonic& s = contact.motion;
    if (oscillates(s)) fastest = std::max(fastest, s.frequency);
    const double of_input = contact.input ? contact.input_share * contact.input->value(0.0) : 0.0;
    slowest = std::max(
        slowest,
        flight(gap(contact, start.q, 0.0), gap_velocity(contact, start.u, 0.0),
               contact.w.dot(acceleration) - s.frequency * s.frequency * value(s, 0.0) + of_input));
  }
  const double vibrates = fastest > 0.0 ? some_periods / fastest : infinity;
  return slowest > 0.0 ? std::min(vibrates, slowest) : vibrates;
}

void set_chatter_time(Model& model, const State& start) {
  constexpr double share = 1e-8;
  const double own = share * time_scale(model, start);
  if (own > 0.0 && std::isfinite(own)) model.chatter_time = own;
}

}  // namespace sprag
