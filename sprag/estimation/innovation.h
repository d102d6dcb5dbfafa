// What an estimate said of the last closing that it was told of: its own gap there, which is zero
// where the estimate is right.
#pragma once

namespace sprag {

struct Innovation {
  double t = -1.0;         ///< of the closing [s]; before the first one -1
  int contact = 0;         ///< from 0
  double gap = 0.0;        ///< of the estimate just before [m]
  double deviation = 0.0;  ///< standard deviation of the gap [m], 0: not estimated
};

/// A filter does not fit where the square of an innovation over its variance is more than the
/// first, or their mean over about innovation_window more than the second: chi^2 of one degree of
/// freedom exceeds the first once in 10^11 events, the mean the second once in 10^7.
inline constexpr double largest_innovation = 45.0;
inline constexpr double largest_mean_innovation = 4.0;
inline constexpr double innovation_window = 16.0;

}  // namespace sprag
