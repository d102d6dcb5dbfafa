// Global search without initial values. A grid over the parameters' box is evaluated on a few
// impacts, the best points are refined (projection.h), and the window grows to all impacts. Far
// from the solution the sum of squares of a long record has a local minimum every fraction of a
// percent; that of a short one does not.
#pragma once

#include <functional>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

struct SearchSettings {
  double good = 0.0;  ///< largest score of a candidate [s]
  /// Decides whether a candidate is a solution. The search ends at the first window with a
  /// solution.
  std::function<bool(const PathFit&)> is_solution;
};

/// Searches fits to all stretches and returns the one with the lowest score. After the first
/// solution, other minima of the same window are still tried once each. Each stretch must have more
/// than 2n impacts.
PathFit search(const MachineFamily& family, const Stretches& stretches,
               const SearchSettings& settings);

/// The best fit to the impacts of one window alone.
PathFit search_window(const MachineFamily& family, const Stretches& window);

/// Number of impacts of a first window.
std::size_t first_window(const MachineFamily& family, const Projection& projection);

/// Number of impacts of a shorter window with four degrees of freedom. It suffices if a wrong path
/// leaves residuals far above the jitter.
std::size_t least_window(const MachineFamily& family, const Projection& projection);

}  // namespace sprag
