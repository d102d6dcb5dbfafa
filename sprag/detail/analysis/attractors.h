// Recognizes equal attractors of many runs.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/simulate.h"

namespace sprag {

/// Labels 1, 2, ... of attractors, equal for equal attractors and 0 for period 0. Labels follow the
/// order by period, then by point, and do not depend on the order of the runs. Two attractors are
/// equal if they have the same period, and no q differs by more than the tolerance times the
/// largest |q| of all, nor any u likewise. Differences below 1e-9 of the largest number of all
/// count as zero. One attractor per row of `points`, 2f columns.
std::vector<int> label_attractors(std::span<const int> periods,
                                  const Eigen::Ref<const Simulation::Rows>& points,
                                  double tolerance = 1e-3);

}  // namespace sprag
