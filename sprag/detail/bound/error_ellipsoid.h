// A set of error states in the coordinates x = (omega z, v) / sqrt 2 of energy_metric.h, |x|^2 the
// energy: the ellipsoid { P^(1/2) y : |y| <= 1 }. Free flight and impacts are linear maps of
// it. A segment is added to it by the ellipsoid of least trace that contains the sum:
//
//   P -> (1 + p) P + (1 + 1 / p) v v^T,   p = |v| / sqrt(tr P),
//
// which contains it for every p > 0 (Durieu, Walter & Polyak 2001).
#pragma once

#include <Eigen/Core>

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {

/// Of a machine with f coordinates; P has 2 f rows. Nothing but the constructor allocates.
class ErrorEllipsoid {
 public:
  /// `free` is the flow of no locked contact. Both must outlive this.
  ErrorEllipsoid(const EnergyMetric& metric, const Flow& free);

  void clear();  ///< to the point 0
  /// Free flight of length tau >= 0 [s]. O(f^3).
  void fly(double tau);
  /// x -> x - (1 + epsilon) n gamma(x): an impact of one contact that touches all of the set.
  void impact(int contact, double epsilon);
  /// Adds the segment from -v to v, 2 f entries.
  void add(const Eigen::VectorXd& v);

  /// The largest |x| in it, at most. O(1): fly(), impact() and add() leave it to update_radius().
  double radius() const { return radius_; }
  void update_radius();  ///< O(f^3)
  /// The largest |gamma(x)| of a contact in it.
  double largest_gap_velocity(int contact) const;

 private:
  const EnergyMetric* metric_;
  const Flow* free_;
  bool is_point_ = true;
  double radius_ = 0.0;
  Eigen::MatrixXd P_;
  Eigen::MatrixXd enter_, leave_;  // to the flow's oscillators (z, v) and back
  OscillatorKernels kernels_;
  Eigen::MatrixXd moved_, Phi_, scratch_;
  Eigen::VectorXd column_;
};

}  // namespace sprag
