#include "sprag/model.h"

#include <cmath>

namespace sprag {

double value(const Output& output, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u) {
  return output.velocity ? output.direction.dot(u) : output.direction.dot(q);
}

double gap_scale(const Contact& contact, const Eigen::VectorXd& q) {
  return contact.w.cwiseAbs().dot(q.cwiseAbs()) + std::abs(contact.motion.amplitude) +
         std::abs(contact.clearance);
}

}  // namespace sprag
