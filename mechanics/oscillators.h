// Independent scalar oscillators z'' + 2 delta z' + kappa z = alpha, in closed form. Every linear
// flow of this library is a bank of them: modes, complex modes, and the excitation's own cosines
// (delta = 0, kappa = Omega^2). delta, kappa >= 0; alpha is zero unless kappa is.
#pragma once

#include <Eigen/Core>

namespace sprag {

/// z and z' of N oscillators.
struct OscillatorState {
  Eigen::ArrayXd z, v;
};

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
  void apply(OscillatorState& state, const Eigen::ArrayXd& alpha, bool drifts) const;
  /// One step from `from` to `to`, two different objects.
  void apply(const OscillatorState& from, const Eigen::ArrayXd& alpha, bool drifts,
             OscillatorState& to) const;
};

}  // namespace sprag
