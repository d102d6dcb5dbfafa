// Which attractors of many runs are the same ones.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/simulate.h"

namespace sprag {

/// Labels 1, 2, ... of attractors, equal for equal ones, 0 where the period is 0; the same in
/// whatever order they come: by period, then by point. Two are equal where they have one period and
/// no q differs by more than the tolerance times the largest |q| of all, no u likewise; what is
/// below 1e-9 of the largest number of all counts as zero. One attractor a row of `points`, 2f
/// columns.
std::vector<int> label_attractors(std::span<const int> periods,
                                  const Eigen::Ref<const Simulation::Rows>& points,
                                  double tolerance = 1e-3);

}  // namespace sprag
