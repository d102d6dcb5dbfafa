// What a run found, held against a reference: impacts, states, penetration. No clock, no process.
#pragma once

#include <limits>
#include <span>

#include "studies/work_precision/method.h"
#include "studies/work_precision/reference.h"

namespace sprag::work_precision {

inline constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

struct ImpactScore {
  int found = 0;                    ///< impacts of the reference that the method has too
  int missed = 0;                   ///< and those that it has not
  int invented = 0;                 ///< impacts of the method far from every impact there is
  double first_missed = not_known;  ///< [s]
  double median_dt = not_known;     ///< of |dt| of what was found [s]
  double max_dt = not_known;        ///< [s]
};

/// Impacts of the reference slower than 1e-4 m/s, the tail of a chatter, need not be found. Each of
/// the others is matched with the nearest impact of the method that is no further than half way to
/// the reference's neighbours and than 0.05 s; both in order of time. Invented is what is not
/// matched and has no impact of the reference, of whatever speed, within 0.02 s. Times beyond the
/// horizon [s] do not count.
ImpactScore score(std::span<const ReferenceImpact> reference, std::span<const double> impacts,
                  double horizon);

struct StateScore {
  /// Mean over the samples of sum |u - u_ref|; samples within 1e-3 s of an impact are left out.
  double l1_u = not_known;
  double sup_q = not_known;    ///< largest |q_i - q_ref,i| over samples and coordinates
  double horizon = not_known;  ///< time of the first sample with an error of q above 1e-2, or end
};

/// q and u have the shape of the reference's; columns that are NaN were not reached: they are left
/// out of the errors and end the horizon. Samples beyond `until` [s] do not count.
StateScore score(const Reference& reference, const Eigen::MatrixXd& q, const Eigen::MatrixXd& u,
                 double until);

/// The deepest that any contact is inside its support at a sample [m], >= 0; q has the samples of
/// the task.
double penetration(const Task& task, const Eigen::MatrixXd& q);

}  // namespace sprag::work_precision
