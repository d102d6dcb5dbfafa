// Where no start is known: the parameters' box is searched on a few impacts, the best places are
// refined (projection.h), and the window grows from there to all impacts. Far from the truth the
// squares of a long record have a minimum every fraction of a percent; those of a short one do not.
#pragma once

#include <functional>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

struct SearchSettings {
  double good = 0.0;  ///< largest score of a candidate [s]
  /// Whether a candidate is a solution. The search ends at the first window that has one.
  std::function<bool(const PathFit&)> is_solution;
};

/// Looks for solutions among fits to all stretches; returns the fit with the least score. Once a
/// solution is found, other minima of the same window are still tried, each once. Each stretch must
/// have more than 2n impacts.
PathFit search(const MachineFamily& family, const Stretches& stretches,
               const SearchSettings& settings);

/// The best fit to some impacts alone, that of one window.
PathFit search_window(const MachineFamily& family, const Stretches& window);

/// Impacts that a first window takes.
std::size_t first_window(const MachineFamily& family, const Projection& projection);

/// Fewer, which leave a freedom of four: enough where a wrong path leaves far more than the jitter.
std::size_t least_window(const MachineFamily& family, const Projection& projection);

}  // namespace sprag
