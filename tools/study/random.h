// Random numbers by counter: Philox4x32-10 (Salmon, Moraes, Dror & Shaw, "Parallel random numbers:
// as easy as 1, 2, 3", SC 2011). A stream is a pure function of its three numbers: it needs no
// state from streams before it, so that a run draws the same wherever and whenever it is computed.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace sprag::study {

/// Ten rounds of Philox on a block of four words, under a key of two.
std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key);

/// What draws are for: a stream each, so that one does not change the draws of another.
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

  /// In [0, 1), 53 bits.
  double uniform();
  /// Of mean 1.
  double exponential() { return -std::log1p(-uniform()); }
  /// Of mean 0 and variance 1 (Box & Muller, one of the pair).
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

}  // namespace sprag::study
