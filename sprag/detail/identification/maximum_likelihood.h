// Maximum likelihood with the true event times tau_k among the unknowns (lifted, as in multiple
// shooting): with x0 of each stretch and theta,
//
//   min sum (tau_k - t_k)^2 / sigma^2   subject to   g_k(tau_1 ... tau_k; x0, theta) = 0,
//
// by Gauss-Newton steps in the null space of the linearized constraints. The path of the machine
// itself is chaotic, the path along given tau is not. The constraints' Jacobian (J for x0 and
// theta, G for tau) is therefore well conditioned, although G alone is not.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// Initial value from a fit of variable projection along the measured times of `stretches`. Its
/// scale is set so that amplitudes that are not sought keep their values.
Likelihood along_measured_times(const MachineFamily& family, const Stretches& stretches,
                                const PathFit& fit);

/// Iterates from the values, x0 and path of `start`. `stretches` has the measured times. The
/// unknowns with the numbers `held` keep their values.
Likelihood maximize_likelihood(const MachineFamily& family, const Stretches& stretches,
                               Likelihood start, std::span<const std::size_t> held = {});
/// The same path and values with the covariance of all unknowns, none of them held.
Likelihood linearized_at(const MachineFamily& family, const Stretches& stretches, Likelihood at);

inline Likelihood maximize_likelihood(const MachineFamily& family, const Stretches& stretches,
                                      const PathFit& start) {
  return maximize_likelihood(family, stretches, along_measured_times(family, stretches, start));
}

}  // namespace sprag
