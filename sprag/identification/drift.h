// How far a machine departs from its model: the `drift` that the timing filter should be told
// (uncertainty.h), from the times of impacts. Drift, and the jitter where it is not told, maximize
// the restricted likelihood (Patterson & Thompson 1971) of linearized_filter.h: what the fit of the
// unknowns takes up of a drift does not count as none.
#pragma once

#include <optional>

#include "sprag/identification/identification.h"

namespace sprag {

struct DriftEstimate {
  double drift = 0.0;   ///< energy per unit of time, the most likely
  double jitter = 0.0;  ///< with it [s]
  /// Where ln L is lower by 1.92: 95 % are between. `low` is 0 where no drift is as likely.
  double low = 0.0, high = 0.0;
  double gain = 0.0;  ///< 2 (ln L(drift) - ln L(0)), chi^2 where there is none

  bool found() const { return gain > 9.0; }
};

/// Of a fit to events of `scene` that has a minimum, whether it is believed or not. The jitter is
/// sought as well unless the fit was told one above 0. None where the fit leaves so much that it
/// may be to other values than the machine's.
std::optional<DriftEstimate> estimate_drift(const Scene& scene, const Identification& fit);

}  // namespace sprag
