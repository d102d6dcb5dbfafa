// Bound on the distance of a machine from a known admissible motion, for any contact events. Let q^
// be a motion with constant gaps >= 0 under every tolerated clearance, e = q - q^, v = u - u^. With
// the energy and a cross term, in modes of mass 1,
//
//   W^2 = 1/2 |v|^2 + 1/2 |e|_K^2 + alpha v^T e =: |x - x^|_P^2,
//   W' <= -rho W + F(t) / sqrt 2,   F = |f - M q^'' - C q^' - K q^|_{M^-1} + tolerances,
//
// W does not grow at impacts and at closed contacts: a contact force does no work on a constant
// gap, and alpha lambda w^T e = -alpha lambda g^ <= 0. rho is the smallest over the corners of the
// tolerated stiffness and damping, alpha the best of a search. Requirements: K > 0, C > 0, an
// impact law that gains no energy, and supports that some q^ can follow.
//
// Among all q^ with constant gaps, the harmonic part of q^ makes the harmonic part of F smallest.
// The stationary J(t) with J' = -rho J + F(t) / sqrt 2 is a weighted mean of F. By Jensen's
// inequality the weighted mean of F^2, a closed form, bounds it. So
//
//   W(t0 + tau) <= J(t0 + tau) + e^(-rho tau) (W(t0) - J(t0)),   least <= J <= ultimate.
#pragma once

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/scene.h"

namespace sprag {

class DissipationCap {
 public:
  /// Solves eigenvalue problems of size 2 f, some hundred times.
  DissipationCap(const EnergyMetric& metric, const Tolerance& tolerance);

  bool exists() const { return rho_ > 0.0; }
  double rho() const { return rho_; }            ///< rate of decay of W [1/s]
  double ultimate() const { return ultimate_; }  ///< limit of W for large times; sqrt of energy

  /// W after a duration >= 0 [s]; infinity if the cap does not exist. Two durations one after the
  /// other give a larger value than their sum.
  double advance(double W, double duration) const;
  /// The largest W after any duration.
  double at_any_later_time(double W) const;

  /// Upper bound on W of a machine within b, in the nominal energy norm, of a state at time t.
  double from_distance(double b, const ModalState& state, double t) const;
  /// Upper bound on the machine's distance from a state at time t, in the nominal energy norm.
  double distance(double W, const ModalState& state, double t) const;
  /// Lower bound on distance() over all states.
  double least_distance(double W) const { return W / root_low_; }

 private:
  struct Parts {
    double norm2 = 0.0, P2 = 0.0;
  };
  void find_admissible(const Tolerance& tolerance);
  bool follow_supports();
  void find_force(const Tolerance& tolerance);
  void find_limits(const Eigen::VectorXd& constant, const Eigen::MatrixXcd& harmonics,
                   double other);
  Parts apart(const ModalState& state, double t) const;

  const EnergyMetric* metric_;
  bool admissible_ = false;
  double alpha_ = 0.0, rho_ = 0.0;
  double root_low_ = 1.0, root_high_ = 1.0;  // roots of the extreme eigenvalues of P
  double largest_ = 0.0;                     // limit of W under the largest F at all times
  double ultimate_ = 0.0;                    // upper limit of J
  double least_ = 0.0;                       // lower limit of J
  // q^ in modal coordinates: constant + Re sum of amplitudes e^(i Omega t).
  Eigen::VectorXd rest_;
  Eigen::MatrixXcd swing_;
};

/// Decay rate rho that holds at all corners of the tolerances, and its alpha, for modes omega > 0
/// and damping D > 0 (f x f); rho = 0: none. Among all alpha the distance of a state in the energy
/// norm is then limited the most: rho times the root of the smallest eigenvalue of P is largest.
struct Decay {
  double rho = 0.0, alpha = 0.0;
};
Decay slowest_decay(const EnergyMetric& metric, const Tolerance& tolerance);

}  // namespace sprag
