// Posterior of state and parameters after an identification: a Kalman filter along the most likely
// path (gauss_newton.h). Each step is linearized about the path; the time of an impact is another
// Gaussian variable.
#pragma once

#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/identification/gauss_newton.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {

/// The belief after the path's last impact, in the coordinates of a FamilyFlight. Where contacts
/// last, the state starts again from a wide prior when all have opened. Allocates.
/// \param family  scene and parameters of the fit
/// \param fit     path with the times of its impacts, stretches in order of time
/// \param sigma   standard deviation of reported times [s]
FilterBelief path_posterior(const SceneValues& family, const FilterModel& model,
                            const EventFit& fit, double sigma);

}  // namespace sprag
