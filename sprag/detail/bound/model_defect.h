// By how much the replica's path fails to be a motion of a machine within the tolerances: the
// residual rho = dC u + dK q - df in the norm of M^-1, which lets the error b grow by
//
//   I = int (k |K q|_{M^-1} + c |C u|_{M^-1} + eta) / sqrt 2 dt
//
// along the path, whatever the machine.
#pragma once

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/mechanics/tolerance.h"

namespace sprag {

/// The defect at one point of a path, and what bounds it nearby.
struct DefectNode {
  double density = 0.0;       ///< the integrand
  double speed = 0.0;         ///< |x'|, energy norm
  double acceleration = 0.0;  ///< |x''| of free flight
  double Ka = 0.0, Cj = 0.0;  ///< |K q''|, |C u''| of free flight, norm of M^-1
};

class ModelDefect {
 public:
  ModelDefect(const EnergyMetric& metric, const Tolerance& tolerance);

  /// False: nothing of the model is off, the integral is zero.
  bool any() const { return any_; }
  double longest_step() const { return longest_step_; }  ///< between nodes of an integral [s]

  /// Of a state whose acceleration is known. `free`: no contact is closed. Does not allocate.
  DefectNode node(const ModalState& state, double t, bool free);

  /// The integral over a step between two nodes of free flight: the trapezoidal rule, which bounds
  /// it but for the curvature of K q and C u.
  double free_step(const DefectNode& from, const DefectNode& to, double duration) const;
  /// The same where clutches may switch inside: by the speed of the path alone.
  double closed_step(const DefectNode& from, double duration) const;

  /// Largest growth of the density along a path of unit speed [1/s].
  double lipschitz() const { return lipschitz_; }
  /// |f''| of the nominal force, at most, norm of M^-1.
  double force_second() const { return force_second_; }

 private:
  const EnergyMetric* metric_;
  Tolerance tolerance_;
  bool any_ = false;
  double longest_step_ = 0.0, lipschitz_ = 0.0;
  double force_second_ = 0.0;  // |f''|, norm of M^-1
  Eigen::VectorXd scratch_, jerk_;
};

}  // namespace sprag
