// Times as unevaluated sums of two doubles. Tick k is at k h exactly: the rounded product is off by
// up to half a unit in the last place of t, and a fast mode turns that into a visible error.
#pragma once

#include <cmath>
#include <cstdint>

namespace sprag {

/// hi + lo exactly, |lo| at most half a unit in the last place of hi.
struct Instant {
  double hi = 0.0;
  double lo = 0.0;
};

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

/// Last tick at or before t; t and h finite, h > 0, the result within the range of int64.
inline std::int64_t last_tick(double t, double h) {
  auto k = static_cast<std::int64_t>(std::floor(t / h));
  while (tick_instant(k, h) - at(t) > 0.0) --k;
  while (tick_instant(k + 1, h) - at(t) <= 0.0) ++k;
  return k;
}

}  // namespace sprag
