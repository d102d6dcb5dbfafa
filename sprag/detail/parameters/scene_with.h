// The machine with other values of parameters.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"

namespace sprag {

/// The scene with these values of some of its parameters, in its beam, frame, model, positions and
/// clock. A factor multiplies what the scene has. The amplitude of a frame's motion stays at
/// another frequency, so that its acceleration grows with the frequency squared.
Scene with(const Scene& scene, const std::vector<Unknown>& unknowns, const Eigen::VectorXd& values);

/// The scene with another value of one parameter.
Scene with(const Scene& scene, const Unknown& unknown, double value);

}  // namespace sprag
