#include "sprag/detail/bound/guarantee.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

bool contradicts(const Eigen::VectorXd& difference, const Eigen::VectorXd& sigma,
                 const Eigen::VectorXd& factors, double bound) {
  if (!std::isfinite(bound)) return false;
  for (Eigen::Index i = 0; i < std::min(difference.size(), sigma.size()); ++i) {
    const double allowed = half_width(factors[i], bound) + claimed_sigmas * sigma[i];
    if (std::isfinite(sigma[i]) && std::abs(difference[i]) > allowed) return true;
  }
  return false;
}

Guarantee::Guarantee(const Scene& scene, Flows& flows, double h)
    : tracker_(scene, flows, h),
      widths_(tracker_.metric()),
      has_widths_(scene.prior.tolerance.any() && why_no_bound(scene).empty()) {
  dq_.setZero(dynamics().coordinates());
  du_ = q_replica_ = u_replica_ = dq_;
  dg_.setZero(dynamics().contacts());
}

void Guarantee::prepare(Confidence& confidence) const {
  if (!has_widths_) return;
  confidence.bound_q.setConstant(widths_.q().size(), infinity);
  confidence.bound_g.setConstant(widths_.gaps().size(), infinity);
  confidence.bound_outputs.setConstant(widths_.outputs().size(), infinity);
}

void Guarantee::check(bool settled, const Eigen::VectorXd& q_replica,
                      const Eigen::VectorXd& u_replica, Eigen::VectorXd& q, Eigen::VectorXd& u,
                      Confidence& confidence) {
  if (settled) {
    bool refuted = false;
    if (confidence.from_filter) {
      dq_ = q - q_replica;
      du_ = u - u_replica;
      for (Eigen::Index i = 0; i < dg_.size(); ++i) dg_[i] = dynamics().W().col(i).dot(dq_);
      refuted = contradicts(dq_, confidence.sigma_q, widths_.q(), confidence.bound) ||
                contradicts(du_, confidence.sigma_u, widths_.u(), confidence.bound) ||
                contradicts(dg_, confidence.sigma_g, widths_.gaps(), confidence.bound);
    }
    if (refuted && !refuted_) ++refutations_;
    refuted_ = refuted;
  }
  confidence.refutations = refutations_;
  if (!refuted_ || !confidence.from_filter) return;
  q = q_replica;
  u = u_replica;
  confidence.from_filter = false;
  for (Eigen::VectorXd* sigma :
       {&confidence.sigma_q, &confidence.sigma_u, &confidence.sigma_g, &confidence.sigma_outputs}) {
    sigma->setConstant(infinity);
  }
}

// Widens the bound's band about the replica to a band about the shown estimate, which may be the
// filter's.
void Guarantee::set_widths(const Eigen::VectorXd& q_replica, const Eigen::VectorXd& u_replica,
                           const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                           Confidence& confidence) {
  if (confidence.bound_q.size() == 0) return;
  dq_ = q - q_replica;
  du_ = u - u_replica;
  const double B = confidence.bound;
  for (Eigen::Index i = 0; i < dq_.size(); ++i) {
    confidence.bound_q[i] = half_width(widths_.q()[i], B) + std::abs(dq_[i]);
  }
  for (Eigen::Index i = 0; i < dg_.size(); ++i) {
    confidence.bound_g[i] =
        half_width(widths_.gaps()[i], B) + std::abs(dynamics().W().col(i).dot(dq_));
  }
  for (Eigen::Index i = 0; i < confidence.bound_outputs.size(); ++i) {
    const Output& output = dynamics().model().outputs[static_cast<std::size_t>(i)];
    const double apart = output.direction.dot(output.velocity ? du_ : dq_);
    confidence.bound_outputs[i] = half_width(widths_.outputs()[i], B) + std::abs(apart);
  }
}

double initial_bound(const Scene& scene) {
  const Prior& prior = scene.prior;
  const std::vector<Force>& forces = scene.model.forces;
  const bool noisy = std::any_of(forces.begin(), forces.end(), [](const Force& force) {
    return force.input && (force.input->noise() > 0.0 || force.input->is_streamed());
  });
  const bool exact = prior.tolerance.any() || (prior.jitter == 0.0 && prior.drift == 0.0 &&
                                               prior.parameters.empty() && !noisy);
  return exact && prior.uncertainty.size() > 0 ? prior.uncertainty.sum() : infinity;
}

}  // namespace sprag
