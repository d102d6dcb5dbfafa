// Seeded random numbers, the same on every platform (the standard fixes the engine but not its
// distributions).
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace sprag::common {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }

  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// With mean 1.
  double exponential() { return -std::log1p(-uniform()); }

  /// With mean 0 and variance 1.
  double normal() {
    const double radius = std::sqrt(2.0 * exponential());
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace sprag::common
