#include "sprag/detail/estimates/uncertainty.h"

#include <cmath>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/energy.h"

namespace sprag {
namespace {

// Without a given uncertainty each mode gets the whole energy scale of the machine, because its
// distribution over the modes is unknown.
Eigen::VectorXd energies_of(const Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  if (scene.prior.uncertainty.size() == f) return scene.prior.uncertainty;
  const double scale = energy_scale(scene.model, scene.prior.start);
  return Eigen::VectorXd::Constant(f, scale > 0.0 ? scale : 1.0);
}

// M^-1 times the noise of sampled forces, per root of the unit of time. Errors of the
// samples with standard deviation sigma at intervals dt act on slow motions as white noise of
// intensity sigma^2 dt.
Eigen::MatrixXd input_noise_of(const Model& model) {
  Eigen::MatrixXd noise_u(model.coordinates(), 0);
  const Dynamics dynamics(model);
  const SampledInputs& inputs = dynamics.inputs();
  for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
    const SampledInput& input = inputs.channel(c);
    const double noise = input.noise() * std::sqrt(input.spacing());
    if (noise == 0.0) continue;
    noise_u.conservativeResize(model.coordinates(), noise_u.cols() + 1);
    noise_u.col(noise_u.cols() - 1) = noise * (inverse(model.M) * inputs.forces().col(c));
  }
  return noise_u;
}

}  // namespace

Uncertainty uncertainty_of(const Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  const NaturalModes modes = natural_modes(scene.model);
  const Eigen::VectorXd energy = energies_of(scene);
  const double longest = length_scale(scene.model, scene.prior.start);
  const auto of_u = [&](const Eigen::VectorXd& of) {
    return Eigen::VectorXd(of.cwiseQuotient(modes.mass).cwiseSqrt());
  };
  const auto of_q = [&](const Eigen::VectorXd& of, bool rigid) {
    Eigen::VectorXd q(f);
    for (Eigen::Index i = 0; i < f; ++i) {
      const double length = longest / modes.Phi.col(i).cwiseAbs().maxCoeff();
      q[i] =
          modes.stiffness[i] > 0.0 ? std::sqrt(of[i] / modes.stiffness[i]) : (rigid ? length : 0.0);
    }
    return q;
  };
  Uncertainty uncertainty{modes.Phi * of_q(energy, true).asDiagonal(),
                          modes.Phi * of_u(energy).asDiagonal(),
                          scene.prior.jitter,
                          {},
                          {},
                          scene.truth.release_penetration};
  if (scene.prior.sigma) {
    uncertainty.q = scene.prior.sigma->q.asDiagonal();
    uncertainty.u = scene.prior.sigma->u.asDiagonal();
  }
  if (scene.prior.drift > 0.0) {
    const Eigen::VectorXd each =
        Eigen::VectorXd::Constant(f, scene.prior.drift / static_cast<double>(f));
    uncertainty.drift_q = modes.Phi * of_q(each, false).asDiagonal();
    uncertainty.drift_u = modes.Phi * of_u(each).asDiagonal();
  }
  if (has_sampled_inputs(scene.model)) uncertainty.input_noise = input_noise_of(scene.model);
  return uncertainty;
}

}  // namespace sprag
