// Independent scalar oscillators z'' + 2 delta z' + kappa z = alpha, in closed form. Every linear
// flow of this library is a bank of them: modes, complex modes, and the excitation's own cosines
// (delta = 0, kappa = Omega^2). delta, kappa >= 0, alpha any constant: its static rest alpha /
// kappa is nowhere split off, since a soft oscillator's is far beyond where it moves.
#pragma once

#include <Eigen/Core>

namespace sprag {

/// z and z' of N oscillators.
struct OscillatorState {
  Eigen::ArrayXd z, v;
};

/// z+ = zz z + zv v, v+ = vz z + vv v.
struct OscillatorKernel {
  double zz, zv, vz, vv;
};

/// What tau makes of one oscillator, with the response of z to alpha = 1; that of v is zv.
struct OscillatorStep : OscillatorKernel {
  double z_alpha;

  void apply(double alpha, double& z, double& v) const {
    const double moved = zz * z + zv * v + z_alpha * alpha;
    v = vz * z + vv * v + zv * alpha;
    z = moved;
  }
};

/// delta, kappa >= 0, tau >= 0.
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

  /// Moves oscillators first..first+count-1 by tau >= 0 from `from` to `to` (which may be the same
  /// object); alpha has N entries. Exact to a few roundings for every regime of damping.
  void propagate(const OscillatorState& from, const Eigen::ArrayXd& alpha, double tau,
                 Eigen::Index first, Eigen::Index count, OscillatorState& to) const;

  /// What tau >= 0 makes of oscillator i where nothing pushes it.
  OscillatorKernel kernel(Eigen::Index i, double tau) const;

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

  /// One step in place; alpha only where `drifts`.
  void apply(OscillatorState& state, const Eigen::ArrayXd& alpha, bool drifts) const {
    rotate(zz.size(), zz.data(), zv.data(), vz.data(), vv.data(), state.z.data(), state.v.data());
    if (drifts) {
      state.z += z_alpha * alpha;
      state.v += v_alpha * alpha;
    }
  }
  /// One step from `from` to `to`, two different objects.
  void apply(const OscillatorState& from, const Eigen::ArrayXd& alpha, bool drifts,
             OscillatorState& to) const;

 private:
  // The arrays are all different ones; to check that at every tick would cost as much as the tick.
  static void rotate(Eigen::Index n, const double* __restrict zz, const double* __restrict zv,
                     const double* __restrict vz, const double* __restrict vv, double* __restrict z,
                     double* __restrict v) {
    constexpr Eigen::Index many = 16;
    if (n >= many) {
      rotate_many(n, zz, zv, vz, vv, z, v);
      return;
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const double moved = zz[i] * z[i] + zv[i] * v[i];
      v[i] = vz[i] * z[i] + vv[i] * v[i];
      z[i] = moved;
    }
  }
  static void rotate_many(Eigen::Index n, const double* __restrict zz, const double* __restrict zv,
                          const double* __restrict vz, const double* __restrict vv,
                          double* __restrict z, double* __restrict v);
};

}  // namespace sprag
