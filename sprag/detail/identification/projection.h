// Parameters from given event times by variable projection (Golub & Pereyra 1973, in Kaufman's
// form): for each theta the best z = (x0, inputs) of the path's linear equations is found by QR,
// and theta alone is sought,
//
//   min over theta of min over z of sum (w_k A_k(theta) z)^2,
//
// so that start, phases and clearances need no guess. Where nothing fixes the scale of z, the mean
// of gamma- is held at -1: (x0, amplitudes, clearances) times a number give the same times.
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
  Eigen::VectorXd values;           ///< of all unknowns; of the linear ones as they were given
  std::vector<Eigen::VectorXd> x0;  ///< of each stretch, 2n entries
  Eigen::VectorXd inputs;           ///< up to a common scale where nothing fixes it
  /// Of gaps at events, divided by the gap velocities within limits [s].
  double rms = std::numeric_limits<double>::infinity();
  double inside = 0.0;  ///< share of the impacts with gamma- > 0

  double score() const { return rms * (1.0 + 10.0 * inside); }
};

class Projection {
 public:
  /// `family` must stay in place.
  explicit Projection(const MachineFamily& family);
  ~Projection();
  Projection(const Projection&) = delete;
  Projection& operator=(const Projection&) = delete;

  /// Numbers of the unknowns that are sought here.
  const std::vector<std::size_t>& nonlinear() const;
  /// Inputs that are free.
  Eigen::Index free_inputs() const;
  /// Nothing fixes the scale of z.
  bool homogeneous() const;

  /// The stretches that count from here on; each must have more than 2n impacts.
  void take(Stretches stretches);

  /// The best z at `values`, all impacts with the same weight.
  PathFit at(const Eigen::VectorXd& values);

  /// Levenberg and Marquardt's steps in the coordinates of the nonlinear unknowns, with impacts
  /// weighted by 1 / |gamma-| within limits.
  PathFit refine(const PathFit& from, int most_steps);

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

}  // namespace sprag
