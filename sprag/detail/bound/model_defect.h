// Defect of the replica's path as a motion of a machine within the tolerances: the residual rho =
// dC u + dK q - df in the norm of M^-1. It increases the error b by
//
//   I = int (k |K q|_{M^-1} + c |C u|_{M^-1} + eta) / sqrt 2 dt
//
// along the path, for every machine within the tolerances.
#pragma once

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/scene.h"

namespace sprag {

/// Defect at one point of a path, and quantities that bound its change.
struct DefectNode {
  double density = 0.0;       ///< the integrand
  double speed = 0.0;         ///< |x'|, energy norm
  double acceleration = 0.0;  ///< |x''| of free flight
  double Ka = 0.0, Cj = 0.0;  ///< |K q''|, |C u''| of free flight, norm of M^-1
};

class ModelDefect {
 public:
  ModelDefect(const EnergyMetric& metric, const Tolerance& tolerance);

  /// False: no model tolerance, so that the integral is zero.
  bool any() const { return any_; }
  double longest_step() const { return longest_step_; }  ///< of an integral [s]

  /// Defect at a state with known acceleration. `free`: no contact is closed. Does not allocate.
  DefectNode node(const ModalState& state, double t, bool free);

  /// Bound on the integral over a step between two nodes of free flight: the trapezoidal rule, plus
  /// its error by the curvature of K q and C u.
  double free_step(const DefectNode& from, const DefectNode& to, double duration) const;
  /// The same for a step in which clutches may switch, by the speed of the path alone.
  double closed_step(const DefectNode& from, double duration) const;

  /// Largest growth of the density along a path of unit speed [1/s].
  double lipschitz() const { return lipschitz_; }
  /// Bound on |f''| of the harmonic forces, norm of M^-1.
  double force_second() const { return force_second_; }
  /// Bound on the total variation of f' of the sampled forces over a duration, norm of M^-1. Their
  /// rate jumps at knots.
  double sampled_variation(double duration) const {
    return duration * sampled_variation_ + 2.0 * sampled_jumps_;
  }

 private:
  const EnergyMetric* metric_;
  Tolerance tolerance_;
  bool any_ = false;
  double longest_step_ = 0.0, lipschitz_ = 0.0;
  double force_second_ = 0.0;  // bound on |f''| of harmonics, norm of M^-1
  // Of sampled forces: variation of f' in one interval between samples, and per unit of time.
  double sampled_jumps_ = 0.0, sampled_variation_ = 0.0;
  Eigen::VectorXd scratch_, jerk_;
};

}  // namespace sprag
