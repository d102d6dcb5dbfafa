// Errors of estimates in their claimed standard deviations.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace sprag::test {

struct Claims {
  double squares = 0.0;  ///< sum of (error / sigma)^2, of the values with a sigma
  std::int64_t count = 0, beyond_five = 0, samples = 0;
  std::vector<double> sigmas;

  double mean() const { return squares / static_cast<double>(count); }
  double share_beyond() const {
    return static_cast<double>(beyond_five) / static_cast<double>(count);
  }
  double share_claimed() const { return static_cast<double>(count) / static_cast<double>(samples); }
  double median() {
    std::nth_element(sigmas.begin(), sigmas.begin() + std::ssize(sigmas) / 2, sigmas.end());
    return sigmas[sigmas.size() / 2];
  }

  void add(double error, double sigma) {
    ++samples;
    if (!std::isfinite(sigma)) return;
    const double z = error / std::hypot(sigma, 1e-13);
    squares += z * z;
    beyond_five += std::abs(z) > 5.0 ? 1 : 0;
    sigmas.push_back(sigma);
    ++count;
  }
  void add(const Eigen::VectorXd& error, const Eigen::VectorXd& sigma) {
    for (Eigen::Index i = 0; i < error.size(); ++i) add(error[i], sigma[i]);
  }
};

}  // namespace sprag::test
