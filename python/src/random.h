// Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror & Shaw, "Parallel random
// numbers: as easy as 1, 2, 3", SC 2011). A stream is a pure function of seed, run and purpose, so
// a run has the same random numbers wherever and whenever it is computed.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace sprag::python {

/// Ten rounds of Philox on a counter of four words with a key of two.
std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key);

/// Purposes of random numbers. Each has its own stream, so that one does not change another.
enum class Purpose : std::uint32_t {
  jitter,
  losses,
  spurious,
  start_of_machine,
  start_of_replica,
  axes
};

class Random {
 public:
  /// Key: the seed. Counter: the block, the purpose, and the number of the run.
  Random(std::uint64_t seed, std::uint64_t run, Purpose purpose)
      : seed_(seed), run_(run), purpose_(purpose) {}

  /// Uniform in [0, 1), 53 bits.
  double uniform();
  /// Exponential with mean 1.
  double exponential() { return -std::log1p(-uniform()); }
  /// Normal with mean 0 and variance 1 (Box & Muller, one number of the pair).
  double normal() {
    const double radius = std::sqrt(2.0 * exponential());
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  std::uint64_t seed_, run_;
  Purpose purpose_;
  std::uint32_t block_ = 0;
  std::array<std::uint32_t, 4> words_{};
  int left_ = 0;
};

}  // namespace sprag::python
