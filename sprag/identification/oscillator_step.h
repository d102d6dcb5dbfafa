// Free flight over a given time: of one damped oscillator in closed form, of coupled ones by a
// matrix exponential, with constant forces.
#pragma once

#include <Eigen/Core>

namespace sprag {

/// y'' + c y' + k y = 1 over tau: y <- yy y + yu y' + force, y' <- uy y + uu y' + yu.
struct OscillatorStep {
  double yy, yu, uy, uu, force;
};
OscillatorStep oscillator_step(double c, double k, double tau);

/// The same for coupled oscillators: (y, y') after tau of (y, y', constant forces), 2n x (2n + J).
Eigen::MatrixXd coupled_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::MatrixXd& constant_forces, double tau);

}  // namespace sprag
