// Times as unevaluated sums of two doubles. Tick k is at exactly k h: the rounded product is off by
// up to half a unit in the last place of t, and a fast mode amplifies that to a visible error.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace sprag {

/// hi + lo exactly, |lo| at most half a unit in the last place of hi.
struct Instant {
  double hi = 0.0;
  double lo = 0.0;
};

/// Time of an object without a time. All comparisons with it are false.
inline constexpr Instant no_instant{std::numeric_limits<double>::quiet_NaN(),
                                    std::numeric_limits<double>::quiet_NaN()};

/// The exact product k h.
inline Instant tick_instant(std::int64_t k, double h) {
  const auto n = static_cast<double>(k);
  const double hi = n * h;
  return {hi, std::fma(n, h, -hi)};
}

inline Instant at(double t) { return {t, 0.0}; }

/// Difference, rounded once or twice near the size of the difference itself.
inline double operator-(const Instant& a, const Instant& b) {
  return (a.hi - b.hi) + (a.lo - b.lo);
}

/// Sum, the low part renormalized.
inline Instant operator+(const Instant& a, double tau) {
  const double sum = a.hi + tau;
  const double part = sum - a.hi;
  const double error = (a.hi - (sum - part)) + (tau - part);
  const double low = a.lo + error;
  const double hi = sum + low;
  return {hi, low - (hi - sum)};
}

/// The largest tick number: doubles represent no larger integers exactly.
inline constexpr std::int64_t max_tick = std::int64_t{1} << 53;

/// Last tick k <= max_tick whose time, rounded to double, is at or before t >= 0; h > 0. For
/// example, t = 10 gives tick 10000 of h = 1e-3, although the exact 10000 h is slightly above 10.
/// No double lies between a tick and its rounded time, so events known up to t are known up to this
/// tick.
inline std::int64_t last_tick(double t, double h) {
  const double quotient = std::floor(t / h);
  if (!(quotient < static_cast<double>(max_tick))) return max_tick;
  auto k = static_cast<std::int64_t>(quotient);
  while (tick_instant(k, h).hi > t) --k;
  while (k < max_tick && tick_instant(k + 1, h).hi <= t) ++k;
  return k;
}

/// First tick at or after t >= 0: the first tick whose estimate contains an event of that time.
inline std::int64_t first_tick_after(double t, double h) {
  const std::int64_t k = last_tick(t, h);
  return tick_instant(k, h) - at(t) >= 0.0 ? k : k + 1;
}

}  // namespace sprag
