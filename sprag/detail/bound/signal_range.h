// Guaranteed range of a signal in a window around one time of a motion, from the amplitudes of its
// oscillators, without sampling.
#pragma once

#include "sprag/detail/mechanics/flow.h"

namespace sprag {

/// Ranges over all |s| <= window.
struct SignalRange {
  double low = 0.0, high = 0.0;            ///< of the signal value
  double rate_low = 0.0, rate_high = 0.0;  ///< of its rate
  double second = 0.0;                     ///< largest absolute second rate
};

/// \brief Taylor's formula at the motion's time. The remainder follows from the energies of the
/// oscillators' derivatives: sqrt(z''^2 + kappa z'^2) never increases forward and increases
/// backward by a factor of at most exp(2 delta s). Drives add their largest contribution.
/// \param window >= 0 [s]; all of it on the motion's flow. Does not allocate.
SignalRange range(const Signal& signal, const Motion& motion, double window);

}  // namespace sprag
