#include "sprag/scene.h"

namespace sprag {

Force frame_force(const Eigen::MatrixXd& M, const ShakenFrame& frame) {
  return {-(M * frame.influence), 0.0, second_derivative(frame.motion), frame.input};
}

Harmonic ground_motion(const Eigen::VectorXd& w, const ShakenFrame& frame) {
  Harmonic motion = frame.motion;
  motion.amplitude *= w.dot(frame.influence);
  return motion;
}

}  // namespace sprag
