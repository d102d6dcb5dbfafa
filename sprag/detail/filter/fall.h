// The latest time at which a signal, such as a gap of the mean, fell below zero.
#pragma once

#include <optional>

namespace sprag {

/// Number of looks in a while in which a gap or a force may be negative.
inline constexpr int looks = 16;

struct Fall {
  double t = 0.0;          ///< the signal fell below zero there, and was negative for a while
  double lowest = 0.0;     ///< its lowest value in that while, as far as was looked
  double lowest_at = 0.0;  ///< time of that value
};

/// Looks at the signal at `looks` + 1 evenly spaced times from `to` back to `from`, until it has
/// fallen below zero, and bisects. `t` is `from` if the signal was negative from there on. Nothing
/// if it was not negative at any of these times.
template <typename Signal>
std::optional<Fall> latest_fall(double from, double to, const Signal& signal) {
  constexpr double tolerance = 1e-6;  // of the interval: negative from `from` on
  constexpr int halvings = 40;
  std::optional<Fall> fall;
  double outside = from;
  for (int i = 0; i <= looks; ++i) {
    const double t = i < looks ? to - i * (to - from) / looks : from;
    const double value = signal(t);
    if (value < 0.0) {
      if (!fall || value < fall->lowest) fall = {t, value, t};
      fall->t = t;
    } else if (fall) {
      outside = t;
      break;
    }
  }
  if (!fall || fall->t == from) return fall;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (outside + fall->t);
    (signal(middle) < 0.0 ? fall->t : outside) = middle;
  }
  if (fall->t <= from + tolerance * (to - from)) fall->t = from;
  return fall;
}

}  // namespace sprag
