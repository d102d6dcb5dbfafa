// Parameters from given event times by variable projection (Golub & Pereyra 1973, in Kaufman's
// form). For each theta a QR factorization gives the best z = (x0, inputs) of the path's linear
// equations, so the iteration is over theta alone:
//
//   min over theta of min over z of sum (w_k A_k(theta) z)^2.
//
// Start, phases and clearances therefore need no guess. If nothing determines the scale of z, the
// mean of gamma- is fixed at -1, because (x0, amplitudes, clearances) times a number give the same
// times.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <vector>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// A machine of the family on a path.
struct PathFit {
  Eigen::VectorXd values;           ///< of all unknowns; linear unknowns keep their given values
  std::vector<Eigen::VectorXd> x0;  ///< start of each stretch, 2n entries
  Eigen::VectorXd inputs;           ///< up to a common factor if the scale is unobservable
  /// Root mean square of the gaps at events over the gap velocities, the latter within limits [s].
  double rms = std::numeric_limits<double>::infinity();
  double inside = 0.0;  ///< share of the impacts with gamma- > 0

  double score() const { return rms * (1.0 + 10.0 * inside); }
};

class Projection {
 public:
  /// `family` must outlive this and must not move.
  explicit Projection(const MachineFamily& family);
  ~Projection();
  Projection(const Projection&) = delete;
  Projection& operator=(const Projection&) = delete;

  /// Numbers of the nonlinear unknowns.
  const std::vector<std::size_t>& nonlinear() const;
  /// Number of free inputs.
  Eigen::Index free_inputs() const;
  /// True if the scale of z is unobservable.
  bool homogeneous() const;

  /// Sets the stretches to fit. Each must have more than 2n impacts.
  void take(Stretches stretches);

  /// The best z at `values`, with equal weights of all impacts.
  PathFit at(const Eigen::VectorXd& values);

  /// Levenberg-Marquardt steps in the coordinates of the nonlinear unknowns. The weights of impacts
  /// are 1 / |gamma-| within limits.
  PathFit refine(const PathFit& from, int most_steps);

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

}  // namespace sprag
