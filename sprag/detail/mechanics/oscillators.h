// Independent scalar oscillators z'' + 2 delta z' + kappa z = alpha, in closed form. Every linear
// flow of this library is a bank of them: modes, complex modes, and the excitation's cosines
// (delta = 0, kappa = Omega^2). delta, kappa >= 0; alpha is any constant. The static rest position
// alpha / kappa is never subtracted, since for a soft oscillator it is much larger than the motion.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace sprag {

/// z and z' of N oscillators.
struct OscillatorState {
  Eigen::ArrayXd z, v;
};

/// z+ = zz z + zv v, v+ = vz z + vv v.
struct OscillatorKernel {
  double zz, zv, vz, vv;
};

/// The kernels of N oscillators.
struct OscillatorKernels {
  Eigen::Index size() const { return zz.size(); }
  void resize(Eigen::Index n) {
    for (Eigen::ArrayXd* x : {&zz, &zv, &vz, &vv}) x->resize(n);
  }

  /// Applies kernels first.. in place to several states: one row per oscillator, one column per
  /// state.
  void apply(Eigen::Index first, Eigen::Ref<Eigen::MatrixXd> z,
             Eigen::Ref<Eigen::MatrixXd> v) const;

  Eigen::ArrayXd zz, zv, vz, vv;
};

/// Propagator of one oscillator over tau, with the response of z to alpha = 1; that of v is zv.
struct OscillatorStep : OscillatorKernel {
  double z_alpha;

  void apply(double alpha, double& z, double& v) const {
    const double moved = zz * z + zv * v + z_alpha * alpha;
    v = vz * z + vv * v + zv * alpha;
    z = moved;
  }
};

/// Requires kappa >= 0. tau < 0 goes back in time, where damped motion grows, as it does for
/// delta < 0.
OscillatorStep oscillator_step(double delta, double kappa, double tau);

/// Constant data of N oscillators.
class Oscillators {
 public:
  Oscillators() = default;
  Oscillators(const Eigen::ArrayXd& delta, const Eigen::ArrayXd& kappa);

  Eigen::Index size() const { return delta_.size(); }
  const Eigen::ArrayXd& delta() const { return delta_; }
  const Eigen::ArrayXd& kappa() const { return kappa_; }
  const Eigen::ArrayXd& root_kappa() const { return root_kappa_; }

  /// Moves oscillators first..first+count-1 by tau from `from` to `to` (which may be the same
  /// object); alpha has N entries. Exact to a few roundings for every regime of damping; for
  /// negative tau relative to the grown motion.
  void propagate(const OscillatorState& from, const Eigen::ArrayXd& alpha, double tau,
                 Eigen::Index first, Eigen::Index count, OscillatorState& to) const;

  /// Propagator of oscillator i over tau without alpha.
  OscillatorKernel kernel(Eigen::Index i, double tau) const;
  /// The same for oscillators first..first+count-1, written into these entries of `of`.
  void kernels(double tau, Eigen::Index first, Eigen::Index count, OscillatorKernels& of) const;

 private:
  Eigen::ArrayXd delta_, kappa_, root_kappa_;
  Eigen::ArrayXd omega_;  // sqrt|kappa - delta^2|
};

/// The propagator of a fixed step: z+ = zz z + zv v + za, v+ = vz z + vv v + va.
struct TickTable {
  TickTable() = default;
  TickTable(const Oscillators& oscillators, double h);

  Eigen::ArrayXd zz, zv, vz, vv;
  Eigen::ArrayXd z_alpha, v_alpha;  ///< response to alpha = 1

  /// One step in place, without alpha.
  void rotate(OscillatorState& state) const {
    if (!pairs_.empty()) {
      rotate_few(zz.size(), pairs_.data(), state.z.data(), state.v.data());
    } else {
      rotate_many(zz.size(), zz.data(), zv.data(), vz.data(), vv.data(), state.z.data(),
                  state.v.data());
    }
  }
  /// Adds the response to alpha (one entry per oscillator) over the step.
  void push(const Eigen::ArrayXd& alpha, OscillatorState& state) const {
    state.z += z_alpha * alpha;
    state.v += v_alpha * alpha;
  }

 private:
  // With few oscillators, loading six array addresses would take half of the tick's time. They have
  // one table with two oscillators side by side.
  static constexpr Eigen::Index many = 16;
  struct Pair {
    double zz[2], zv[2], vz[2], vv[2];
  };
  std::vector<Pair> pairs_;  // only for fewer than `many` oscillators

  // __restrict: the arrays never overlap, and a check for that at every tick costs as much as the
  // tick.
  static void rotate_few(Eigen::Index n, const Pair* __restrict pair, double* __restrict z,
                         double* __restrict v) {
    Eigen::Index i = 0;
    for (; i + 1 < n; i += 2, ++pair) {
      const double z0 = z[i], z1 = z[i + 1], v0 = v[i], v1 = v[i + 1];
      z[i] = pair->zz[0] * z0 + pair->zv[0] * v0;
      z[i + 1] = pair->zz[1] * z1 + pair->zv[1] * v1;
      v[i] = pair->vz[0] * z0 + pair->vv[0] * v0;
      v[i + 1] = pair->vz[1] * z1 + pair->vv[1] * v1;
    }
    if (i == n) return;
    const double z0 = z[i], v0 = v[i];
    z[i] = pair->zz[0] * z0 + pair->zv[0] * v0;
    v[i] = pair->vz[0] * z0 + pair->vv[0] * v0;
  }
  static void rotate_many(Eigen::Index n, const double* __restrict zz, const double* __restrict zv,
                          const double* __restrict vz, const double* __restrict vv,
                          double* __restrict z, double* __restrict v);
};

}  // namespace sprag
