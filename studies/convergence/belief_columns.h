// Columns of a square root of the covariance of (q, u), moved by a flow and merged.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/mechanics/flow.h"

namespace sprag::studies {

/// The covariance of a start; the mean stays.
void set_start(const Uncertainty& uncertainty, Belief& belief);

/// Moves and merges the columns of beliefs of one machine: nothing but scratch, so that neither
/// allocates.
class BeliefColumns {
 public:
  BeliefColumns() = default;
  /// For up to `columns` columns; `free` is the machine's free flight, f its coordinates.
  BeliefColumns(const Flow& free, Eigen::Index f, Eigen::Index columns);

  /// S on this flow for tau; nothing where tau is not positive. The mean stays.
  void move(const Flow& flow, double tau, Belief& belief);

  /// Householder reflections of S^T leave P = S S^T as it is and, of more than 4 f columns, all but
  /// 2 f zero.
  void merge(Belief& belief);

 private:
  Eigen::MatrixXd z_, v_;  // S in a flow's oscillators
  OscillatorKernels kernels_;
  Eigen::MatrixXd merged_;  // columns x 2 f
};

}  // namespace sprag::studies
