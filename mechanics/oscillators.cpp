#include "mechanics/oscillators.h"

#include <cmath>

// Sanitizers do not work with functions that are chosen at load time.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SPRAG_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SPRAG_WIDEST
#endif

namespace sprag {
namespace {

struct Kernel {
  double zz, zv, vz, vv;
};

Kernel underdamped(double delta, double kappa, double omega, double decay, double tau) {
  const double c = decay * std::cos(omega * tau);
  const double s = omega > 0.0 ? decay * std::sin(omega * tau) / omega : decay * tau;
  return {c + delta * s, s, -kappa * s, c - delta * s};
}

// sigma = sqrt(delta^2 - kappa) > 0. Written with exponents <= 0 only; delta - sigma without
// cancellation.
Kernel overdamped(double delta, double kappa, double sigma, double tau) {
  const double slow = std::exp(-kappa / (delta + sigma) * tau);
  const double one_minus_fast = -std::expm1(-2.0 * sigma * tau);
  const double s = slow * one_minus_fast / (2.0 * sigma);
  const double c = slow * (1.0 - 0.5 * one_minus_fast);
  return {c + delta * s, s, -kappa * s, c - delta * s};
}

// Response of z to alpha = 1 where kappa = 0; its rate is zv.
double drift(double delta, double zv, double tau) {
  const double x = 2.0 * delta * tau;
  // (tau - zv) / (2 delta) loses digits as 1/x while the damping has hardly acted; the series
  // tau^2 (1/2! - x/3! + x^2/4! - ...) has all of them, up to x = 1 with the terms to x^17/19!.
  if (x < 1.0) {
    double sum = 1.0;
    for (int k = 19; k > 2; --k) sum = 1.0 - x * sum / k;
    return 0.5 * tau * tau * sum;
  }
  return (tau - zv) / (2.0 * delta);
}

}  // namespace

Oscillators::Oscillators(const Eigen::ArrayXd& delta, const Eigen::ArrayXd& kappa)
    : delta_(delta),
      kappa_(kappa),
      root_kappa_(kappa.sqrt()),
      omega_((kappa - delta.square()).abs().sqrt()) {}

void Oscillators::propagate(const OscillatorState& from, const Eigen::ArrayXd& alpha, double tau,
                            Eigen::Index first, Eigen::Index count, OscillatorState& to) const {
  // Neighbours often share their damping (a beam's modes all do): one exponential serves them.
  double decay_delta = 0.0;
  double decay = 1.0;
  for (Eigen::Index i = first; i < first + count; ++i) {
    const double delta = delta_[i];
    const double kappa = kappa_[i];
    const double z = from.z[i];
    const double v = from.v[i];
    Kernel k;
    if (delta * delta > kappa) {
      k = overdamped(delta, kappa, omega_[i], tau);
    } else {
      if (delta != decay_delta) {
        decay_delta = delta;
        decay = std::exp(-delta * tau);
      }
      k = underdamped(delta, kappa, omega_[i], decay, tau);
    }
    to.z[i] = k.zz * z + k.zv * v;
    to.v[i] = k.vz * z + k.vv * v;
    if (alpha[i] != 0.0) {
      to.z[i] += alpha[i] * drift(delta, k.zv, tau);
      to.v[i] += alpha[i] * k.zv;
    }
  }
}

TickTable::TickTable(const Oscillators& oscillators, double h) {
  const Eigen::Index n = oscillators.size();
  const Eigen::ArrayXd one = Eigen::ArrayXd::Ones(n);
  const Eigen::ArrayXd zero = Eigen::ArrayXd::Zero(n);
  OscillatorState response{zero, zero};
  oscillators.propagate({one, zero}, zero, h, 0, n, response);
  zz = response.z;
  vz = response.v;
  oscillators.propagate({zero, one}, zero, h, 0, n, response);
  zv = response.z;
  vv = response.v;
  const Eigen::ArrayXd alpha = (oscillators.kappa() == 0.0).cast<double>();
  oscillators.propagate({zero, zero}, alpha, h, 0, n, response);
  z_alpha = response.z;
  v_alpha = response.v;
}

// Wider registers where the processor has them; the same roundings, since nothing is fused.
SPRAG_WIDEST void TickTable::rotate_many(Eigen::Index n, const double* __restrict zz,
                                         const double* __restrict zv, const double* __restrict vz,
                                         const double* __restrict vv, double* __restrict z,
                                         double* __restrict v) {
  for (Eigen::Index i = 0; i < n; ++i) {
    const double moved = zz[i] * z[i] + zv[i] * v[i];
    v[i] = vz[i] * z[i] + vv[i] * v[i];
    z[i] = moved;
  }
}

void TickTable::apply(const OscillatorState& from, const Eigen::ArrayXd& alpha, bool drifts,
                      OscillatorState& to) const {
  to.z = zz * from.z + zv * from.v;
  to.v = vz * from.z + vv * from.v;
  if (drifts) {
    to.z += z_alpha * alpha;
    to.v += v_alpha * alpha;
  }
}

}  // namespace sprag
