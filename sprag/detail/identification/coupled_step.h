// Free flight of coupled oscillators over a given time, by a matrix exponential. Uncoupled
// oscillators have a closed form (mechanics/oscillators.h).
#pragma once

#include <Eigen/Core>

namespace sprag {

/// Transition matrix over tau from (y, y', constant forces) to (y, y'), 2n x (2n + J), of y'' + C
/// y' + K y = sum of these forces. C and K are n x n, constant_forces is n x J.
Eigen::MatrixXd coupled_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::MatrixXd& constant_forces, double tau);

}  // namespace sprag
