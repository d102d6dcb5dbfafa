// The scene of a fit: Identification::fitted.
#pragma once

#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief The scene with all that a fit determines: the values, their uncertainty and correlations,
/// the start and its uncertainty, the jitter and the drift.
///
/// The start of the scene remains if the fit does not reach back to `fit.begins`. The drift is the
/// estimate if a departure was found, else its 95 % limit. The jitter of a refused fit is its
/// scatter. The tolerance is that of fitted_tolerance() if it covers all fitted parameters, else 0.
/// \param scene the scene that was fitted.
/// \param fit a fit with values.
Scene fitted_scene(const Scene& scene, const Identification& fit);

}  // namespace sprag
