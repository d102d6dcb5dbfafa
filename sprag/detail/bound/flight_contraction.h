// Contraction of the distance of two motions of one machine in free flight: |exp(A tau)|, the
// largest singular value in the energy norm |x|^2 = 1/2 |u|_M^2 + 1/2 |q|_K^2. With uncoupled modes
// it is the largest of their closed forms, else an upper bound from a table (contraction_table.h).
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "sprag/detail/bound/contraction_table.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/oscillators.h"
#include "sprag/scene.h"

namespace sprag {

class FlightContraction {
 public:
  /// For the machine of `flows` with C multiplied by `damping_factor` >= 0. Throws ModelError.
  explicit FlightContraction(const Flows& flows, double damping_factor = 1.0);

  /// \return upper bound on |exp(A tau)|^2 for tau >= 0 [s]; in [0, 1]. Does not allocate.
  double square(double tau);

  /// The same at a node at or before tau, from a table that is filled on demand, for calls at every
  /// tick. Never less than square(tau).
  double square_at_node(double tau);

  double damping() const { return damping_; }  ///< bound on the norm of the damping [1/s]

 private:
  static constexpr int first_octave = -40, octaves = 64, nodes_in_octave = 16;

  bool is_dense_ = false;
  ContractionTable dense_;
  Oscillators oscillators_;  // of the free flow with the changed damping
  Eigen::Index frequencies_ = 0;
  Eigen::Index modes_ = 0;
  double damping_ = 0.0;
  double rigid_ = 0.0;  // a mode up to this frequency counts as a rigid motion
  OscillatorKernels kernels_;
  std::array<double, std::size_t{octaves} * nodes_in_octave> known_;  // < 0: not computed yet
};

/// Largest |exp(A_m tau)| of all machines with (1 + k) K and (1 + c) C, |k| <= stiffness, |c| <=
/// damping, each in the energy norm of its own K. Scaling the time changes (1 + k) K to K, with C
/// multiplied by c' = (1 + c) / sqrt(1 + k) and tau by sqrt(1 + k). The norm never increases with
/// tau. Five values of c' cover their range with a margin of |C| tau times half their spacing.
class ToleratedContraction {
 public:
  ToleratedContraction(const Flows& flows, const Tolerance& tolerance);

  /// \return upper bound on the norm for tau >= 0 [s]; in [0, 1]. Neither allocates.
  double operator()(double tau);
  double at_node(double tau);  ///< from the table; never less

 private:
  template <typename Square>
  double largest(double tau, Square&& square_of);

  std::vector<FlightContraction> nodes_;
  double time_factor_ = 1.0;
  double margin_ = 0.0;  // |C| times half the spacing [1/s]
};

}  // namespace sprag
