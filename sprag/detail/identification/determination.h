// Practical identifiability: which unknowns the events determine, by the likelihood itself. For an
// optimum with the sum of squares S, the 95 % interval of unknown k is the set of values c with
//
//   min over all other unknowns of S(c) <= S + 3.84 sigma^2
//
// (profile likelihood, Venzon & Moolgavkar 1988). The curvature of S at the optimum gives the same
// interval where the problem is nearly linear. On nearly periodic orbits it is far too small.
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// Interval of an unknown at an optimum, in its coordinate.
struct Determined {
  /// Its standard deviation is below half of the range that it is sought in, and no other optimum
  /// or end of the range contradicts its value.
  bool determined = true;
  double sigma = 0.0;           ///< standard deviation, from the wider side of the 95 % interval
  double down = 0.0, up = 0.0;  ///< distances to the ends of the 95 % interval
  /// The optimum is at a physical bound; the interval to the other side is one-sided.
  bool at_physical_bound = false;
};

struct Determination {
  /// The optimum with undetermined unknowns at their nominal values, if nominal_fits.
  Likelihood solution;
  std::vector<Determined> unknowns;
  /// The events fit about as well with undetermined unknowns at their nominal values. If false, the
  /// events determine combinations of them only, and `solution` is the optimum.
  bool nominal_fits = true;
  /// Number of an unknown whose optimum is at the end of its range although the nominal value does
  /// not fit; -1: none.
  int at_end_of_range = -1;
};

/// Numbers of the unknowns that are undetermined by the curvature at `at`, which need not be an
/// optimum. `sigma` is the standard deviation of event times [s].
std::vector<std::size_t> undetermined_at(const MachineFamily& family, const Stretches& stretches,
                                         const Likelihood& at, double sigma);

/// Includes the uncertainty of held unknowns in the standard deviations of the others.
void include_held(const MachineFamily& family, const Stretches& stretches,
                  std::span<const std::size_t> held, double sigma, Determination& determination);

/// Determines the unknowns of an optimum. `others` are the values of other optima at which the
/// events fit as well. `sigma` is the standard deviation of event times [s]. Throws Interrupted.
Determination determine(const MachineFamily& family, const Stretches& stretches,
                        const Likelihood& optimum, const std::vector<Eigen::VectorXd>& others,
                        double sigma);

}  // namespace sprag
