// Free flight of coupled oscillators over a given time, by a matrix exponential; those that are not
// coupled have a closed form (mechanics/oscillators.h).
#pragma once

#include <Eigen/Core>

namespace sprag {

/// (y, y') after tau of (y, y', constant forces), 2n x (2n + J), where y'' + C y' + K y is the sum
/// of these forces. C and K n x n, constant_forces n x J.
Eigen::MatrixXd coupled_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::MatrixXd& constant_forces, double tau);

}  // namespace sprag
