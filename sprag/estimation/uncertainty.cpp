#include "sprag/estimation/uncertainty.h"

#include <algorithm>
#include <cmath>

#include "sprag/mechanics/energy.h"

namespace sprag {
namespace {

// Nothing shorter than this is seen of a machine whose rigid motions have no scale of their own.
double longest_length(const Scene& scene) {
  double length = scene.replica.q.cwiseAbs().maxCoeff();
  for (const Contact& contact : scene.model.contacts) {
    length = std::max({length, std::abs(contact.clearance), std::abs(contact.motion.amplitude)});
  }
  return length > 0.0 ? length : 1.0;
}

}  // namespace

Uncertainty uncertainty_of(const Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  const NaturalModes modes = natural_modes(scene.model);
  const Eigen::VectorXd one_each = Eigen::VectorXd::Constant(f, 1.0 / static_cast<double>(f));
  const Eigen::VectorXd energy = scene.uncertainty.size() == f ? scene.uncertainty : one_each;
  const auto of_u = [&](const Eigen::VectorXd& of) {
    return Eigen::VectorXd(of.cwiseQuotient(modes.mass).cwiseSqrt());
  };
  const auto of_q = [&](const Eigen::VectorXd& of, bool rigid) {
    Eigen::VectorXd q(f);
    for (Eigen::Index i = 0; i < f; ++i) {
      const double length = longest_length(scene) / modes.Phi.col(i).cwiseAbs().maxCoeff();
      q[i] =
          modes.stiffness[i] > 0.0 ? std::sqrt(of[i] / modes.stiffness[i]) : (rigid ? length : 0.0);
    }
    return q;
  };
  Uncertainty uncertainty{modes.Phi * of_q(energy, true).asDiagonal(),
                          modes.Phi * of_u(energy).asDiagonal(),
                          scene.jitter,
                          {},
                          {},
                          scene.release_penetration};
  if (scene.sigma) {
    uncertainty.q = scene.sigma->q.asDiagonal();
    uncertainty.u = scene.sigma->u.asDiagonal();
  }
  if (scene.drift > 0.0) {
    uncertainty.drift_q = modes.Phi * of_q(scene.drift * one_each, false).asDiagonal();
    uncertainty.drift_u = modes.Phi * of_u(scene.drift * one_each).asDiagonal();
  }
  return uncertainty;
}

}  // namespace sprag
