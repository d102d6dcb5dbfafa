// The machine of a scene as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/scene.h"

namespace sprag {

/// Adds what pictures need of the machine: coordinates, contacts, outputs and `decay_rate`, the
/// alpha of damping C = alpha M, null for other damping.
void write_machine(const Scene& scene, nlohmann::ordered_json& object);

}  // namespace sprag
