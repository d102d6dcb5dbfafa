// Which unknowns the events determine, judged by the likelihood itself. About an optimum with a sum
// of squares S, the 95 % interval of unknown k is the set of values c at which
//
//   min over all else of S(c) <= S + 3.84 sigma^2
//
// (profile likelihood, Venzon & Moolgavkar 1988). The curvature of S at the optimum gives the same
// interval where the problem is nearly linear; on nearly periodic orbits it is far too small.
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// An unknown at an optimum, in its coordinate.
struct Determined {
  /// Its interval is narrower than the range that it is sought in.
  bool determined = true;
  double sigma = 0.0;           ///< standard deviation, from the wider side of the 95 % interval
  double down = 0.0, up = 0.0;  ///< how far the 95 % interval reaches to either side
  /// The optimum is at a physical bound; the interval to the other side is a one-sided one.
  bool at_physical_bound = false;
};

struct Determination {
  /// With undetermined unknowns at their nominal values.
  Likelihood solution;
  std::vector<Determined> unknowns;
  /// With undetermined unknowns at their nominal values the events fit as well as before. Otherwise
  /// the events determine only combinations of them, and `solution` is the optimum.
  bool nominal_fits = true;
  /// Number of an unknown whose optimum is at the end of the range that it is sought in, while the
  /// nominal value does not fit; -1: none.
  int at_end_of_range = -1;
};

/// Numbers of the unknowns that the events do not determine by the curvature at `at`, at which none
/// has to be optimal. `sigma` is the standard deviation of event times [s].
std::vector<std::size_t> undetermined_at(const MachineFamily& family, const Stretches& stretches,
                                         const Likelihood& at, double sigma);

/// Takes what is not known of held unknowns into the deviations of the others.
void include_held(const MachineFamily& family, const Stretches& stretches,
                  std::span<const std::size_t> held, double sigma, Determination& determination);

/// Of an optimum; `others` are the values of other optima at which the events fit as well. `sigma`
/// is the standard deviation of event times [s]. Throws Interrupted.
Determination determine(const MachineFamily& family, const Stretches& stretches,
                        const Likelihood& optimum, const std::vector<Eigen::VectorXd>& others,
                        double sigma);

}  // namespace sprag
