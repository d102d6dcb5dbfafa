// Maximum likelihood with the true event times tau_k among the unknowns ("lifted", as multiple
// shooting is): with x0 of each stretch and theta,
//
//   min sum (tau_k - t_k)^2 / sigma^2   subject to   g_k(tau_1 ... tau_k; x0, theta) = 0,
//
// by Gauss and Newton's steps in the null space of the linearized constraints. A path that the
// machine itself takes is chaotic; one along given tau is not, so that the constraints, J for x0
// and theta and G for tau side by side, are well conditioned where G alone is not.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

struct Likelihood {
  Eigen::VectorXd values;           ///< of all unknowns, P
  std::vector<Eigen::VectorXd> x0;  ///< free part of the motion at each stretch's start, 2n
  Stretches path;                   ///< with the true times
  std::vector<Eigen::VectorXd> gamma;
  /// Of each impact: the share of its error that the solution takes up, 0 to 1. (tau - t) /
  /// (sigma sqrt(1 - leverage)) is standard normal where the machine and sigma are right.
  std::vector<Eigen::VectorXd> leverage;

  bool converged = false;
  double squares = 0.0;        ///< sum of (tau - t)^2 of timed impacts [s^2]
  int timed = 0;               ///< impacts
  int freedom = 0;             ///< timed impacts less unknowns
  double largest_start = 0.0;  ///< of any stretch, in motions as large as the largest on the path
  double violation = 0.0;  ///< largest |g_k / gamma_k-| that the path leaves at its own times [s]
  /// In coordinates of the unknowns, for a jitter of 1 s, P x P; 0 for one that is held or at a
  /// bound.
  Eigen::MatrixXd covariance;
  std::vector<bool> at_bound;  ///< of each unknown: its optimum is at an end of its range
  /// Of x0 of each stretch, for a jitter of 1 s.
  std::vector<Eigen::MatrixXd> x0_covariance;

  double scatter() const;  ///< sqrt(squares / freedom) [s]
};

/// Where to start: a fit of variable projection along the measured times, those of `stretches`,
/// its scale set so that amplitudes that are not sought are as they are.
Likelihood along_measured_times(const MachineFamily& family, const Stretches& stretches,
                                const PathFit& fit);

/// From values, x0 and path of `start` on; `stretches` has the measured times. The unknowns of
/// these numbers are held at their values.
Likelihood maximize_likelihood(const MachineFamily& family, const Stretches& stretches,
                               Likelihood start, std::span<const std::size_t> held = {});
/// The same path and values with the covariance of all unknowns there, none of them held.
Likelihood linearized_at(const MachineFamily& family, const Stretches& stretches, Likelihood at);

inline Likelihood maximize_likelihood(const MachineFamily& family, const Stretches& stretches,
                                      const PathFit& start) {
  return maximize_likelihood(family, stretches, along_measured_times(family, stretches, start));
}

}  // namespace sprag
