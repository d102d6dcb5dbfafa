// The lowest value of a function of one variable near a start, by parabolas through three points.
#pragma once

#include <algorithm>
#include <cmath>

namespace sprag {

struct Minimum {
  double x = 0.0;
  double J = 0.0;
  double step = 0.0;       ///< to the points beside x, > 0
  double deviation = 0.0;  ///< sqrt(2 / J''), the standard deviation if J is -2 log L; 0: J is flat
};

/// Goes downhill from `start` within [lowest, highest], in steps that grow, then fits parabolas,
/// until it stands within a small part of the deviation. J may be infinite, not at the start.
template <typename Function>
Minimum descend(Function J, Minimum start, double lowest, double highest) {
  constexpr int most_steps = 60;
  constexpr double close = 0.05;  // of the deviation
  constexpr double flat = 1e-6;   // difference of J that says nothing
  const double least = 1e-15 * std::max({std::abs(lowest), std::abs(highest)});
  Minimum at = start;
  for (int i = 0; i < most_steps; ++i) {
    at.step = std::clamp(at.step, least, 0.25 * (highest - lowest));
    // At an end of the range the parabola stands beside it.
    const double low = std::max(at.x - at.step, lowest);
    const double high = std::min(at.x + at.step, highest);
    const double J_low = low < at.x ? J(low) : at.J;
    const double J_high = high > at.x ? J(high) : at.J;
    if (J_low < at.J || J_high < at.J) {
      const bool down = J_low < J_high;
      at.x = down ? low : high;
      at.J = down ? J_low : J_high;
      at.step *= 2.0;
      continue;
    }
    if (!(low < at.x && at.x < high)) {  // the lowest value is at an end
      // There exp(-J / 2) falls exponentially.
      const double rise = J_low + J_high - 2.0 * at.J;
      at.deviation = rise > flat ? 2.0 * at.step / rise : 0.0;
      if (at.step <= least || rise < 1.0) break;
      at.step *= 0.25;
      continue;
    }
    const double fall = (at.J - J_low) / (at.x - low);
    const double rise = (J_high - at.J) / (high - at.x);
    const double curvature = 2.0 * (rise - fall) / (high - low);
    if (!(J_low + J_high - 2.0 * at.J > flat)) {
      at.deviation = 0.0;
      if (at.step >= 0.25 * (highest - lowest)) break;
      at.step *= 4.0;
      continue;
    }
    at.deviation = std::isfinite(curvature) ? std::sqrt(2.0 / curvature) : 0.0;
    const double slope = 0.5 * (fall + rise);
    const double move =
        std::isfinite(curvature) ? std::clamp(-slope / curvature, low - at.x, high - at.x) : 0.0;
    const double J_there = move != 0.0 ? J(at.x + move) : at.J;
    if (J_there < at.J) {
      at.x += move;
      at.J = J_there;
    }
    const bool fine = at.step < 3.0 * at.deviation;
    if (at.step <= least || (fine && std::abs(move) < close * at.deviation)) break;
    at.step = std::isfinite(curvature) ? std::max(at.deviation, 0.1 * at.step) : 0.25 * at.step;
  }
  return at;
}

}  // namespace sprag
