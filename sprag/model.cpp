#include "sprag/model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sprag {

double value(const Output& output, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u) {
  return output.velocity ? output.direction.dot(u) : output.direction.dot(q);
}

ImpactRestitution restitution_at(const Contact& contact, double gamma) {
  const RestitutionCurve& curve = contact.curve;
  const double epsilon = contact.restitution, v = -gamma;
  if (curve.is_constant() || !(v > 0.0)) return {epsilon};
  if (curve.at.empty()) {
    const double line = epsilon + curve.slope * v;
    return line > 0.0 ? ImpactRestitution{line, curve.slope, 0.0} : ImpactRestitution{};
  }
  const auto above = std::upper_bound(curve.at.begin(), curve.at.end(), v);
  const auto k = static_cast<std::size_t>(above - curve.at.begin());
  if (k == 0) return {epsilon};
  const double scale = epsilon / curve.value.front();
  if (k == curve.at.size()) return {scale * curve.value.back()};
  const double slope =
      scale * (curve.value[k] - curve.value[k - 1]) / (curve.at[k] - curve.at[k - 1]);
  return {scale * curve.value[k - 1] + slope * (v - curve.at[k - 1]), slope, 0.0};
}

ImpactRestitution restitution_over(const Contact& contact, double gamma, double sigma) {
  if (contact.curve.is_constant() || !(sigma > 0.0) || gamma == 0.0) {
    return restitution_at(contact, gamma);
  }
  // Gauss-Hermite quadrature of 5 nodes.
  constexpr std::array<double, 5> nodes{-2.856970013872806, -1.355626179974266, 0.0,
                                        1.355626179974266, 2.856970013872806};
  constexpr std::array<double, 5> weights{0.011257411327720693, 0.22207592200561266,
                                          0.5333333333333333, 0.22207592200561266,
                                          0.011257411327720693};
  double mean = 0.0, product = 0.0, square = 0.0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const double at = gamma + nodes[k] * sigma;
    const double rebound = restitution_at(contact, at).epsilon * at;
    mean += weights[k] * rebound;
    product += weights[k] * nodes[k] * rebound;
    square += weights[k] * rebound * rebound;
  }
  const double epsilon = mean / gamma;
  return {epsilon, (epsilon - product / sigma) / gamma,
          std::sqrt(std::max(square - mean * mean - product * product, 0.0))};
}

double largest_change(const Contact& contact) {
  const RestitutionCurve& curve = contact.curve;
  // d(epsilon v)/dv is linear in v between two points of the curve. A falling line ends at
  // epsilon = 0, with -epsilon(0).
  double largest = largest_restitution(contact);
  for (std::size_t k = 0; k + 1 < curve.at.size(); ++k) {
    for (const std::size_t end : {k, k + 1}) {
      const auto [epsilon, slope, none] = restitution_at(contact, -curve.at[k]);
      const double at_end = epsilon + slope * (curve.at[end] - curve.at[k]);
      largest = std::max(largest, std::abs(at_end + slope * curve.at[end]));
    }
  }
  return largest;
}

double largest_restitution(const Contact& contact) {
  double largest = contact.restitution;
  for (const double v : contact.curve.at) {
    largest = std::max(largest, restitution_at(contact, -v).epsilon);
  }
  return largest;
}

double gap_scale(const Contact& contact, const Eigen::VectorXd& q) {
  const double harmonic = contact.w.cwiseAbs().dot(q.cwiseAbs()) +
                          std::abs(contact.motion.amplitude) + std::abs(contact.clearance);
  if (!contact.input) return harmonic;
  // e(t) may grow without bound after the record. The record itself scales the rounding errors.
  double largest = contact.input->largest(0);
  if (!std::isfinite(largest))
    largest = std::abs(contact.input->displacement(contact.input->last()));
  return harmonic + std::abs(contact.input_share) * largest;
}

bool has_curves(const Model& model) {
  return std::any_of(model.contacts.begin(), model.contacts.end(),
                     [](const Contact& contact) { return !contact.curve.is_constant(); });
}

bool has_sampled_inputs(const Model& model) {
  return std::any_of(model.forces.begin(), model.forces.end(),
                     [](const Force& force) { return force.input != nullptr; }) ||
         std::any_of(model.contacts.begin(), model.contacts.end(),
                     [](const Contact& contact) { return contact.input != nullptr; });
}

double end_of_inputs(const Model& model) {
  double end = std::numeric_limits<double>::infinity();
  for (const Force& force : model.forces) {
    if (force.input) end = std::min(end, force.input->end());
  }
  for (const Contact& contact : model.contacts) {
    if (contact.input) end = std::min(end, contact.input->end());
  }
  return end;
}

}  // namespace sprag
