// An assessment as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/assessment.h"
#include "sprag/scene.h"

namespace sprag {

/// Adds all figures without rounding, and the findings. Infinite figures are null.
void write_json(const Assessment& assessment, nlohmann::ordered_json& object);

/// Adds what pictures need of the machine: coordinates, contacts, outputs and `decay_rate`, the
/// alpha of damping C = alpha M, null for other damping.
void write_machine(const Scene& scene, nlohmann::ordered_json& object);

}  // namespace sprag
