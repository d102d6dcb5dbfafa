// Innovation of the last reported closing: the gap that the estimate predicts there. It is zero for
// a perfect estimate.
#pragma once

#include <cstdint>

namespace sprag {

struct Innovation {
  double t = -1.0;         ///< time of the closing [s]; -1: none yet
  int contact = 0;         ///< from 0
  double gap = 0.0;        ///< gap of the estimate just before [m]
  double deviation = 0.0;  ///< standard deviation of the gap [m]; 0: not estimated
};

}  // namespace sprag
