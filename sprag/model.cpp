#include "sprag/model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sprag {

double value(const Output& output, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u) {
  return output.velocity ? output.direction.dot(u) : output.direction.dot(q);
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
