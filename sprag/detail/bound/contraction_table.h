// How far free flight brings two motions together where damping couples the modes: an upper bound
// on |exp(A tau)|, the largest singular value of the flight in the energy norm, from a table.
//
// In the energy's own coordinates, (omega z, z') of the natural modes, A is skew but for the
// damping: |exp(A tau)| never rises with tau, so that its value at an earlier node holds, and
// |exp(A (a + b))| <= |exp(A a)| |exp(A b)|. The energy does not see where a rigid motion is, and
// nothing else depends on it: such a mode has a velocity here and no position.
#pragma once

#include <vector>

#include "sprag/model.h"

namespace sprag {

class ContractionTable {
 public:
  /// Of no machine: 1 for every tau.
  ContractionTable() = default;
  /// Takes work in proportion to the cube of the coordinates' number: some 0.1 s for 60. Throws
  /// ModelError if M is not positive definite.
  explicit ContractionTable(const Model& model);

  /// For tau >= 0; in [0, 1]. Does not allocate.
  double operator()(double tau) const;

  /// Largest natural frequency [rad/s], and a bound on the norm of the damping [1/s].
  double omega_max() const { return omega_max_; }
  double damping() const { return damping_; }

 private:
  struct Node {
    double tau, sigma;
  };

  std::vector<Node> nodes_;  // ascending tau
  double omega_max_ = 0.0;
  double damping_ = 0.0;
};

}  // namespace sprag
