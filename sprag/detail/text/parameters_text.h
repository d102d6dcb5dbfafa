// Uncertain parameters of a scene, for reports.
#pragma once

#include <string>

#include "sprag/scene.h"

namespace sprag {

/// "uncertain parameters: impact.restitution 0.7 +- 0.01, beam.damping 0.2 +- 0.002 (considered)",
/// wrapped; empty if the scene has none.
std::string parameters_text(const Scene& scene);

}  // namespace sprag
