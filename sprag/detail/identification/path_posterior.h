// Posterior of state and parameters after an identification: a Kalman filter along the most likely
// path (maximum_likelihood.h). Each step is linearized about the path; the time of an impact is
// another Gaussian variable.
#pragma once

#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/identification/maximum_likelihood.h"

namespace sprag {

/// The belief after the path's last impact, in the coordinates of a FamilyFlight. Allocates.
/// \param family    modal machine family
/// \param path      most likely path, with the times of its impacts
/// \param measured  reported times of the same impacts
/// \param sigma     standard deviation of reported times [s]
FilterBelief path_posterior(const MachineFamily& family, const FilterModel& model,
                            const Likelihood& path, const Stretches& measured, double sigma);

}  // namespace sprag
