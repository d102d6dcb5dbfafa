#include "sprag/detail/replica/penetration.h"

#include <algorithm>
#include <cmath>

namespace sprag {
namespace {

constexpr double gap_rounding = 1e-9;  // share of the machine's length
constexpr double covered = 4.0;        // standard deviations

}  // namespace

double penetration(std::span<const Contact> contacts, const Eigen::Ref<const Eigen::VectorXd>& q,
                   double t, const Eigen::VectorXd& sigma_gap, double length) {
  double deepest = 0.0;
  Eigen::Index i = 0;
  for (const Contact& contact : contacts) {
    const double sigma = i < sigma_gap.size() ? sigma_gap[i] : 0.0;
    ++i;
    const double allowed = gap_rounding * length + (std::isfinite(sigma) ? covered * sigma : 0.0);
    const double depth =
        -(contact.w.head(q.size()).dot(q) + support_motion(contact, t) + contact.clearance);
    if (depth > allowed) deepest = std::max(deepest, depth);
  }
  return deepest;
}

}  // namespace sprag
