// Bounds of a signal about one time of a motion, both ways, from the amplitudes of its oscillators:
// no value between samples is missed.
#pragma once

#include "sprag/detail/mechanics/flow.h"

namespace sprag {

/// Over all |s| <= window.
struct SignalRange {
  double low = 0.0, high = 0.0;            ///< of the signal
  double rate_low = 0.0, rate_high = 0.0;  ///< of its rate
  double second = 0.0;                     ///< largest absolute second rate
};

/// \brief Taylor's formula at the motion's time, its remainder by the energies of the oscillators'
/// derivatives: sqrt(z''^2 + kappa z'^2) never rises forward and rises backward by exp(2 delta s)
/// at most. Drives add what they can.
/// \param window >= 0 [s]; all of it on the motion's flow. Does not allocate.
SignalRange range(const Signal& signal, const Motion& motion, double window);

}  // namespace sprag
