// Contraction of free flight for damping that couples the modes: an upper bound on |exp(A tau)|,
// the largest singular value in the energy norm, from a table.
//
// In the coordinates (omega z, z') of the natural modes A is skew-symmetric except for the damping.
// |exp(A tau)| therefore never increases with tau, so that the value at an earlier node is a bound,
// and |exp(A (a + b))| <= |exp(A a)| |exp(A b)|. The energy does not depend on the position of a
// rigid motion, nor does any other coordinate. Such a mode has only its velocity here.
#pragma once

#include <vector>

#include "sprag/model.h"

namespace sprag {

class ContractionTable {
 public:
  /// Empty table: 1 for every tau.
  ContractionTable() = default;
  /// Cost O(f^3), about 0.1 s for f = 60. Throws ModelError if M is not positive definite.
  explicit ContractionTable(const Model& model);

  /// Bound for tau >= 0; in [0, 1]. Does not allocate.
  double operator()(double tau) const;

  /// Bound on the norm of the damping [1/s].
  double damping() const { return damping_; }

 private:
  struct Node {
    double tau, sigma;
  };

  std::vector<Node> nodes_;  // ascending tau
  double damping_ = 0.0;
};

}  // namespace sprag
