#include "sprag/detail/mechanics/oscillators.h"

#include <cmath>

#include "sprag/detail/mechanics/widest.h"

namespace sprag {
namespace {

using Kernel = OscillatorKernel;

Kernel underdamped(double delta, double kappa, double omega, double decay, double tau) {
  const double c = decay * std::cos(omega * tau);
  const double s = omega > 0.0 ? decay * std::sin(omega * tau) / omega : decay * tau;
  return {c + delta * s, s, -kappa * s, c - delta * s};
}

// sigma = sqrt(delta^2 - kappa) > 0. For tau >= 0 all exponents are <= 0; delta - sigma is computed
// without cancellation. Negative damping is damping backwards in time.
Kernel overdamped(double delta, double kappa, double sigma, double tau) {
  if (delta < 0.0) {
    const Kernel k = overdamped(-delta, kappa, sigma, -tau);
    return {k.zz, -k.zv, -k.vz, k.vv};
  }
  const double slow = std::exp(-kappa / (delta + sigma) * tau);
  const double one_minus_fast = -std::expm1(-2.0 * sigma * tau);
  const double s = slow * one_minus_fast / (2.0 * sigma);
  const double c = slow * (1.0 - 0.5 * one_minus_fast);
  return {c + delta * s, s, -kappa * s, c - delta * s};
}

// Response of z to alpha = 1, accurate to all digits where (1 - zz) / kappa cancels. Its rate is
// k.zv.
double step_response(double delta, double kappa, double omega, const Kernel& k, double tau) {
  if (delta < 0.0) return step_response(-delta, kappa, omega, k, -tau);
  if (delta == 0.0) {
    const double half = 0.5 * omega * tau;
    const double sinc = half == 0.0 ? 1.0 : std::sin(half) / half;
    return 0.5 * tau * tau * sinc * sinc;
  }
  const double x = 2.0 * delta * tau;
  const double y = kappa * tau * tau;
  const bool is_overdamped = delta * delta > kappa;
  // For tau < 0 the fast growing terms cancel in zz.
  const bool far_back = x < -2.0 && is_overdamped && 2.0 * omega > delta;
  if (!far_back && (std::abs(1.0 - k.zz) > 0.25 || (y > 1.0 && !is_overdamped))) {
    return (1.0 - k.zz) / kappa;
  }
  if (std::abs(x) < 2.0) {
    // tau^2 (s_0 + s_1 + ...), (n + 2)(n + 1) s_n = -x (n + 1) s_(n-1) - y s_(n-2); y <= 1 here.
    double before = 0.0;
    double term = 0.5;
    double sum = 0.5;
    for (int n = 1; n < 30 && std::abs(term) + std::abs(before) > 0x1p-56; ++n) {
      const double next = -(x * term + y * before / (n + 1)) / (n + 2);
      before = term;
      term = next;
      sum += term;
    }
    return tau * tau * sum;
  }
  // Far overdamped: the sum of a slow and a fast decay of very different rates.
  const double fast = delta + omega;
  const double slow = kappa / fast;
  const double slowly = slow > 0.0 ? -std::expm1(-slow * tau) / slow : tau;
  return (slowly + std::expm1(-fast * tau) / fast) / (2.0 * omega);
}

// Adjacent oscillators often have the same damping (all modes of a beam do) and share one
// exponential.
class Neighbours {
 public:
  explicit Neighbours(double tau) : tau_(tau) {}

  Kernel next(double delta, double kappa, double omega) {
    if (delta * delta > kappa) return overdamped(delta, kappa, omega, tau_);
    if (delta != delta_) {
      delta_ = delta;
      decay_ = std::exp(-delta * tau_);
    }
    return underdamped(delta, kappa, omega, decay_, tau_);
  }

 private:
  double tau_, delta_ = 0.0, decay_ = 1.0;
};

}  // namespace

OscillatorStep oscillator_step(double delta, double kappa, double tau) {
  const double omega = std::sqrt(std::abs(kappa - delta * delta));
  const Kernel kernel = Neighbours(tau).next(delta, kappa, omega);
  return {kernel, step_response(delta, kappa, omega, kernel, tau)};
}

Oscillators::Oscillators(const Eigen::ArrayXd& delta, const Eigen::ArrayXd& kappa)
    : delta_(delta),
      kappa_(kappa),
      root_kappa_(kappa.sqrt()),
      omega_((kappa - delta.square()).abs().sqrt()) {}

OscillatorKernel Oscillators::kernel(Eigen::Index i, double tau) const {
  return Neighbours(tau).next(delta_[i], kappa_[i], omega_[i]);
}

void Oscillators::propagate(const OscillatorState& from, const Eigen::ArrayXd& alpha, double tau,
                            Eigen::Index first, Eigen::Index count, OscillatorState& to) const {
  Neighbours neighbours(tau);
  for (Eigen::Index i = first; i < first + count; ++i) {
    const double z = from.z[i];
    const double v = from.v[i];
    const Kernel k = neighbours.next(delta_[i], kappa_[i], omega_[i]);
    to.z[i] = k.zz * z + k.zv * v;
    to.v[i] = k.vz * z + k.vv * v;
    if (alpha[i] != 0.0) {
      to.z[i] += alpha[i] * step_response(delta_[i], kappa_[i], omega_[i], k, tau);
      to.v[i] += alpha[i] * k.zv;
    }
  }
}

void OscillatorKernels::apply(Eigen::Index first, Eigen::Ref<Eigen::MatrixXd> z,
                              Eigen::Ref<Eigen::MatrixXd> v) const {
  for (Eigen::Index k = 0; k < z.cols(); ++k) {
    for (Eigen::Index i = 0; i < z.rows(); ++i) {
      const double z_k = z(i, k);
      z(i, k) = zz[first + i] * z_k + zv[first + i] * v(i, k);
      v(i, k) = vz[first + i] * z_k + vv[first + i] * v(i, k);
    }
  }
}

void Oscillators::kernels(double tau, Eigen::Index first, Eigen::Index count,
                          OscillatorKernels& of) const {
  Neighbours neighbours(tau);
  for (Eigen::Index i = first; i < first + count; ++i) {
    const Kernel k = neighbours.next(delta_[i], kappa_[i], omega_[i]);
    of.zz[i] = k.zz;
    of.zv[i] = k.zv;
    of.vz[i] = k.vz;
    of.vv[i] = k.vv;
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
  oscillators.propagate({zero, zero}, one, h, 0, n, response);
  z_alpha = response.z;
  v_alpha = response.v;
  if (n >= many) return;
  pairs_.resize(static_cast<std::size_t>(n + 1) / 2, {});
  for (Eigen::Index i = 0; i < n; ++i) {
    Pair& pair = pairs_[static_cast<std::size_t>(i / 2)];
    pair.zz[i % 2] = zz[i];
    pair.zv[i % 2] = zv[i];
    pair.vz[i % 2] = vz[i];
    pair.vv[i % 2] = vv[i];
  }
}

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

}  // namespace sprag
