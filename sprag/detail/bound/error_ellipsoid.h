// Set of error states in the coordinates x = (omega z, v) / sqrt 2 of energy_metric.h, |x|^2 the
// energy: the ellipsoid { P^(1/2) y : |y| <= 1 }. Free flight and impacts map it linearly. The sum
// with a segment is enclosed by the ellipsoid of least trace:
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

/// For a machine with f coordinates; P has 2 f rows. Only the constructor allocates.
class ErrorEllipsoid {
 public:
  /// `free` is the flow without locked contacts. Both must outlive this.
  ErrorEllipsoid(const EnergyMetric& metric, const Flow& free);

  void clear();  ///< makes it the point 0
  /// Free flight of length tau >= 0 [s]. O(f^3).
  void fly(double tau);
  /// x -> x - (1 + epsilon) n gamma(x): an impact of one contact that every state of the set has.
  void impact(int contact, double epsilon);
  /// Adds the segment from -v to v, 2 f entries.
  void add(const Eigen::VectorXd& v);

  /// Upper bound on |x| in the set, as of the last update_radius(); fly(), impact() and add() do
  /// not update it.
  double radius() const { return radius_; }
  void update_radius();  ///< O(f^3)
  /// Largest |gamma(x)| of a contact in the set.
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
