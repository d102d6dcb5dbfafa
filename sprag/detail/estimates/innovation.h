// What an estimate predicted of the last closing that was reported: its own gap there, which is
// zero where the estimate is right.
#pragma once

#include <cstdint>

namespace sprag {

struct Innovation {
  double t = -1.0;         ///< of the closing [s]; before the first one -1
  int contact = 0;         ///< from 0
  double gap = 0.0;        ///< of the estimate just before [m]
  double deviation = 0.0;  ///< standard deviation of the gap [m], 0: not estimated
};

}  // namespace sprag
