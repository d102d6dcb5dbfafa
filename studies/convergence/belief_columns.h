// Columns of a square root of the covariance of (q, u): flow over a time, and merging.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/mechanics/flow.h"

namespace sprag::studies {

/// Sets the covariance of a start; the mean does not change.
void set_start(const Uncertainty& uncertainty, Belief& belief);

/// Moves and merges the columns of beliefs of one machine. It owns only scratch memory, so that its
/// functions do not allocate.
class BeliefColumns {
 public:
  BeliefColumns() = default;
  /// For up to `columns` columns. `free` is the machine's free flight, f its number of coordinates.
  BeliefColumns(const Flow& free, Eigen::Index f, Eigen::Index columns);

  /// Moves S on this flow for tau; does nothing for tau <= 0. The mean does not change.
  void move(const Flow& flow, double tau, Belief& belief);

  /// Householder reflections of S^T keep P = S S^T. Of more than 4 f columns they make all but 2 f
  /// zero.
  void merge(Belief& belief);

 private:
  Eigen::MatrixXd z_, v_;  // S in a flow's oscillators
  OscillatorKernels kernels_;
  Eigen::MatrixXd merged_;  // columns x 2 f
};

}  // namespace sprag::studies
