#include "sprag/detail/mechanics/polynomial_response.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {
namespace {

using Wide = long double;

// Homogeneous part over tau.
void set_kernel(Wide delta, Wide kappa, Wide tau, PolynomialStep& step) {
  const Wide discriminant = delta * delta - kappa;
  Wide c = 0.0L;
  Wide s = 0.0L;
  if (discriminant > 0.0L) {
    const Wide sigma = std::sqrt(discriminant);
    const Wide slow = std::exp(-kappa / (delta + sigma) * tau);
    const Wide one_minus_fast = -std::expm1(-2.0L * sigma * tau);
    s = slow * one_minus_fast / (2.0L * sigma);
    c = slow * (1.0L - 0.5L * one_minus_fast);
  } else {
    const Wide omega = std::sqrt(-discriminant);
    const Wide decay = std::exp(-delta * tau);
    s = omega > 0.0L ? decay * std::sin(omega * tau) / omega : decay * tau;
    c = decay * std::cos(omega * tau);
  }
  step.zz = c + delta * s;
  step.zv = s;
  step.vz = -kappa * s;
  step.vv = c - delta * s;
}

// S_n from the series of z: s_(k+2) = -2 delta s_(k+1) - kappa s_k, started by s_(n+2) = 1.
// Requires 2 delta tau and sqrt(kappa) tau <= 1/2.
void set_responses(Wide delta, Wide kappa, Wide tau, PolynomialStep& step) {
  constexpr int terms = 20;
  const Wide x = 2.0L * delta * tau;
  const Wide y = kappa * tau * tau;
  for (std::size_t n = 0; n < polynomial_terms; ++n) {
    // In units of tau^(n+2): term k is s_k tau^k / k!.
    Wide term = 1.0L;
    for (std::size_t k = 1; k <= n + 2; ++k) term *= tau / static_cast<Wide>(k);
    Wide before = 0.0L;
    Wide sum = term;
    auto k = static_cast<Wide>(n + 2);
    for (int i = 0; i < terms; ++i) {
      // term_(k+1) = -x term_k / (k+1) - y term_(k-1) / ((k+1) k)
      const Wide next = -(x * term + y * before / k) / (k + 1.0L);
      before = term;
      term = next;
      sum += term;
      k += 1.0L;
    }
    step.S[n] = sum;
  }
}

// From `part` to 2 part: the force is expanded at the middle again.
void double_up(Wide delta, Wide kappa, Wide part, PolynomialStep& step) {
  std::array<Wide, polynomial_terms> powers{};  // part^j / j!
  powers[0] = 1.0L;
  for (std::size_t j = 1; j < polynomial_terms; ++j) {
    powers[j] = powers[j - 1] * part / static_cast<Wide>(j);
  }
  std::array<Wide, polynomial_terms> doubled{};
  for (std::size_t n = 0; n < polynomial_terms; ++n) {
    const Wide rate = n == 0 ? step.zv : step.S[n - 1];
    doubled[n] = step.zz * step.S[n] + step.zv * rate;
    for (std::size_t j = 0; j <= n; ++j) doubled[n] += powers[n - j] * step.S[j];
  }
  step.S = doubled;
  set_kernel(delta, kappa, 2.0L * part, step);
}

}  // namespace

PolynomialStep polynomial_step(long double delta, long double kappa, long double tau) {
  const Wide fastest = std::max(2.0L * delta, std::sqrt(kappa)) * tau;
  int doublings = 0;
  std::frexp(2.0L * fastest, &doublings);
  doublings = std::max(doublings, 0);
  Wide part = std::ldexp(tau, -doublings);
  PolynomialStep step{};
  set_kernel(delta, kappa, part, step);
  set_responses(delta, kappa, part, step);
  for (; doublings > 0; --doublings) {
    double_up(delta, kappa, part, step);
    part *= 2.0L;
  }
  return step;
}

void move_under_force(double delta, double kappa, const PolynomialForce& F, double tau, double& z,
                      double& v) {
  const double damping = 2.0 * delta;
  const double x = std::max(damping, std::sqrt(kappa)) * std::abs(tau);
  if (x <= 1.0) {
    // Enough terms for a remainder below the rounding error. With F_5 it is of the order of
    // x^(terms - 7) / terms! of the terms of F.
    const int terms = x < 0.02 ? 12 : x < 0.1 ? 14 : x < 0.4 ? 16 : 19;
    double before = z;
    double now = v;
    double factor = tau;  // tau^k / k!, k = 1, 2, ...
    double of_z = z + factor * v;
    double of_v = v;
    for (int k = 2; k < terms; ++k) {
      const auto n = static_cast<std::size_t>(k - 2);
      const double force = n < polynomial_terms ? F[n] : 0.0;
      const double next = force - damping * now - kappa * before;
      of_v += factor * next;
      factor *= tau / k;
      of_z += factor * next;
      before = now;
      now = next;
    }
    z = of_z;
    v = of_v + factor * (-damping * now - kappa * before);
    return;
  }
  const double y = kappa * tau * tau;
  if (delta * delta <= kappa && y >= 0.25) {
    // S_n = (tau^n / n! - S_(n-2) - 2 delta S_(n-1)) / kappa. Its rounding errors are those of the
    // static rest position.
    const OscillatorStep k = oscillator_step(delta, kappa, tau);
    double older = k.zv;
    double old = k.z_alpha;
    double of_z = k.zz * z + k.zv * v + F[0] * old;
    double of_v = k.vz * z + k.vv * v + F[0] * older;
    double power = 1.0;
    for (std::size_t n = 1; n < polynomial_terms; ++n) {
      power *= tau / static_cast<double>(n);
      const double S = (power - older - damping * old) / kappa;
      older = old;
      old = S;
      of_z += F[n] * old;
      of_v += F[n] * older;
    }
    z = of_z;
    v = of_v;
    return;
  }
  Wide wide_z = z;
  Wide wide_v = v;
  polynomial_step(delta, kappa, std::max(tau, 0.0)).apply(F, wide_z, wide_v);
  z = static_cast<double>(wide_z);
  v = static_cast<double>(wide_v);
}

}  // namespace sprag
