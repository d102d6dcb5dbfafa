// Comparison of a run with a reference: impacts, states, penetration. No clock, no process.
#pragma once

#include <limits>
#include <span>

#include "studies/work_precision/method.h"
#include "studies/work_precision/reference.h"

namespace sprag::work_precision {

inline constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

struct ImpactScore {
  int found = 0;     ///< impacts of the reference that the method has
  int missed = 0;    ///< impacts of the reference that it does not have
  int invented = 0;  ///< impacts of the method far from every impact of the reference
  double first_missed = not_known;  ///< [s]
  double median_dt = not_known;     ///< of |dt| over the found impacts [s]
  double max_dt = not_known;        ///< [s]
};

/// Impacts of the reference slower than 1e-4 m/s, the tail of a chatter, need not be found. Each of
/// the others is matched with the nearest impact of the method that is no further away than 0.05 s
/// and half the distance to the reference's neighbours, in order of time. An impact of the method
/// is invented if it is not matched and the reference has no impact, of any speed, within 0.02 s.
/// Times beyond the horizon [s] do not count.
ImpactScore score(std::span<const ReferenceImpact> reference, std::span<const double> impacts,
                  double horizon);

struct StateScore {
  /// Mean over the samples of sum |u - u_ref|; samples within 1e-3 s of an impact are left out.
  double l1_u = not_known;
  double sup_q = not_known;    ///< largest |q_i - q_ref,i| over samples and coordinates
  double horizon = not_known;  ///< time of the first sample with an error of q above 1e-2, or end
};

/// q and u have the shape of the reference's. Columns of NaN were not reached: they are left out of
/// the errors and end the horizon. Samples beyond `until` [s] do not count.
StateScore score(const Reference& reference, const Eigen::MatrixXd& q, const Eigen::MatrixXd& u,
                 double until);

/// Largest penetration of any contact at a sample [m], >= 0; q has the samples of the task.
double penetration(const Task& task, const Eigen::MatrixXd& q);

}  // namespace sprag::work_precision
