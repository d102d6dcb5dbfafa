#include "sprag/identification/oscillator_step.h"

#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace sprag {

OscillatorStep oscillator_step(double c, double k, double tau) {
  const double delta = 0.5 * c;
  const double square_of_rate = k - delta * delta;
  double cosine = 0.0, sine = 0.0;  // e^(-delta tau) (cos, sin / omega), or the hyperbolic ones
  if (square_of_rate > 0.0) {
    const double omega = std::sqrt(square_of_rate);
    const double decay = std::exp(-delta * tau);
    cosine = decay * std::cos(omega * tau);
    sine = decay * std::sin(omega * tau) / omega;
  } else {
    const double rate = std::sqrt(-square_of_rate);
    const double slow = std::exp((rate - delta) * tau);
    const double fast = std::exp(-(rate + delta) * tau);
    cosine = 0.5 * (slow + fast);
    sine = rate * tau < 1e-8 ? tau * slow : 0.5 * fast * std::expm1(2.0 * rate * tau) / rate;
  }
  OscillatorStep step{cosine + delta * sine, sine, -k * sine, cosine - delta * sine, 0.0};
  if (k * tau * tau > 1e-4) {
    step.force = (1.0 - step.yy) / k;
    return step;
  }
  // Next to no spring: the integral of yu without 1 / k.
  if (c * tau > 0.1) {
    const double root = std::sqrt(-square_of_rate);
    const double fast = delta + root, slow = k / fast;
    const auto integral = [tau](double rate) {  // of e^(-rate t)
      return rate * tau > 1e-300 ? -std::expm1(-rate * tau) / rate : tau;
    };
    step.force = (integral(slow) - integral(fast)) / (fast - slow);
    return step;
  }
  // Gauss's rule of 5 points for a function that is next to straight.
  constexpr double points[] = {0.046910077030668, 0.2307653449471585, 0.5, 0.7692346550528415,
                               0.953089922969332};
  constexpr double weights[] = {0.1184634425280945, 0.2393143352496832, 0.2844444444444444,
                                0.2393143352496832, 0.1184634425280945};
  for (int i = 0; i < 5; ++i) {
    const double at = points[i] * tau;
    const double x = square_of_rate * at * at;  // sin(sqrt x) / sqrt x, or the hyperbolic one
    const double sinc = 1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0));
    step.force += weights[i] * tau * at * std::exp(-delta * at) * sinc;
  }
  return step;
}

Eigen::MatrixXd coupled_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::MatrixXd& constant_forces, double tau) {
  const Eigen::Index n = K.rows(), J = constant_forces.cols();
  Eigen::MatrixXd generator = Eigen::MatrixXd::Zero(2 * n + J, 2 * n + J);
  generator.block(0, n, n, n).setIdentity();
  generator.block(n, 0, n, n) = -K;
  generator.block(n, n, n, n) = -C;
  generator.block(n, 2 * n, n, J) = constant_forces;
  generator *= tau;
  return generator.exp().topRows(2 * n);
}

}  // namespace sprag
