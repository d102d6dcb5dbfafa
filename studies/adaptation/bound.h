// Lower limit of V of an adaptive observer after a number of impacts.
#pragma once

#include "sprag/scene.h"

namespace sprag::adaptation_study {

/// The least expected V right after the machine's impact number `impacts`, for an estimator that
/// has only the impact times. Each time has a normal error of `sigma` [s]; the start and the
/// parameters that the scene declares uncertain are unknown. It is the energy of the state's errors
/// by the Cramer-Rao bound at the machine: the inverse of the joint information of the times about
/// start and parameters.
double least_V(const Scene& machine, int impacts, double sigma);

}  // namespace sprag::adaptation_study
