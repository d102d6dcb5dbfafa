// How small V of an adaptive observer can be at all after so many impacts.
#pragma once

#include "sprag/scene.h"

namespace sprag::adaptation_study {

/// The least expected V right behind the machine's impact number `impacts`, of whoever knows its
/// times alone, with a normal error of `sigma` [s] each, and neither its start nor the parameters
/// that its scene says may be wrong: the energy of the state's errors by the Cramer-Rao bound at
/// the machine, the inverse of the information that the times have of start and parameters
/// together.
double least_V(const Scene& machine, int impacts, double sigma);

}  // namespace sprag::adaptation_study
