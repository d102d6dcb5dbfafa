// Seeded random numbers and matrices, the same on every platform (the standard fixes the engine but
// not its distributions).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace sprag {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [low, high).
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }

  /// In [0, 1).
  double uniform() { return uniform(0.0, 1.0); }

  /// With mean 1.
  double exponential() { return -std::log1p(-uniform()); }

  /// With mean 0 and variance 1.
  double normal() {
    const double radius = std::sqrt(2.0 * exponential());
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

  double log_uniform(double low, double high) {
    return std::exp(uniform(std::log(low), std::log(high)));
  }

  double phase() { return uniform(-std::numbers::pi, std::numbers::pi); }

  /// In [low, high], including both ends.
  int integer(int low, int high) {
    return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1));
  }

  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

  /// Entries in [-1, 1).
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index columns);
  Eigen::VectorXd vector(Eigen::Index n);

  Eigen::MatrixXd orthogonal(Eigen::Index n);

  /// Symmetric positive definite, eigenvalues in [low, high].
  Eigen::MatrixXd positive_definite(Eigen::Index n, double low, double high);

 private:
  std::mt19937_64 engine_;
};

}  // namespace sprag
