#include "sprag/scene.h"

#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {

Force frame_force(const Eigen::MatrixXd& M, const ShakenFrame& frame) {
  return {-(M * frame.influence), 0.0, second_derivative(frame.motion), frame.input};
}

Harmonic ground_motion(const Eigen::VectorXd& w, const ShakenFrame& frame) {
  Harmonic motion = frame.motion;
  motion.amplitude *= w.dot(frame.influence);
  return motion;
}

Scene with_stream(const Scene& scene, std::shared_ptr<SampledInput>& input) {
  Scene streamed = scene;
  streamed.stream_duration = 0.0;
  for (Force& force : streamed.model.forces) {
    if (!force.input) continue;
    if (!input) {
      const double samples = std::ceil((1.0 + SampledInput::largest_rate_error) *
                                       scene.stream_duration / force.input->spacing());
      input = std::make_shared<SampledInput>(
          SampledInput::streamed(*force.input, static_cast<std::size_t>(samples) + 2));
    }
    force.input = input;
  }
  if (streamed.frame && streamed.frame->input) streamed.frame->input = input;
  return streamed;
}

// With correlation = V Lambda V^T, S = diag(sigma) V Lambda^1/2. Rounding may make an eigenvalue
// negative.
Eigen::MatrixXd ParameterUncertainty::root_of_covariance() const {
  if (empty()) return Eigen::MatrixXd(0, 0);
  const ExtendedEigenpairs pairs = eigenpairs(correlation.cast<Extended>());
  const VectorR roots = pairs.values.cwiseMax(Extended(0)).cwiseSqrt();
  const MatrixR scaled = pairs.vectors * roots.asDiagonal();
  return sigma.asDiagonal() * scaled.cast<double>();
}

}  // namespace sprag
