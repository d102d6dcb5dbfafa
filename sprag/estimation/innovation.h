// What an estimate said of the last closing that it was told of: its own gap there, which is zero
// where the estimate is right. And when a filter fits its innovations, and when one that did not is
// believed again.
#pragma once

#include <algorithm>
#include <cstdint>

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
/// A filter that says more than this of an event did not hold it possible, and begins again: no
/// tail of what is not quite Gaussian reaches so far.
inline constexpr double impossible_innovation = 1e4;

/// How many events must fit before a filter that did not fit is believed again: the 2 f that
/// determine its state, and so many more, twice as many each time that it fails anew, until 8 times
/// as many have fitted.
struct Probation {
  static constexpr std::int64_t shortest = 8, longest = 1024, forgiven_after = 8;
  std::int64_t events = shortest;

  void fail() { events = std::min(2 * events, longest); }
  /// So many have fitted of a machine of f coordinates. Whether it is passed.
  bool pass(std::int64_t fitted, std::int64_t f) {
    const bool passed = fitted >= 2 * f + events;
    if (fitted >= forgiven_after * events) events = shortest;
    return passed;
  }
};

}  // namespace sprag
