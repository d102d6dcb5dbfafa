// An assessment as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/analysis/guaranteed_widths.h"
#include "sprag/scene.h"

namespace sprag {

/// Adds all figures without rounding, and the findings. Infinite figures are null.
void write_json(const Assessment& assessment, nlohmann::ordered_json& object);

/// Adds `uncertain_parameters`, an array, if the scene has any.
void write_parameters(const Scene& scene, nlohmann::ordered_json& object);

/// Adds `guaranteed`, if there is one. Infinite figures are null.
void write_guaranteed(const std::optional<GuaranteedWidths>& widths,
                      nlohmann::ordered_json& object);

}  // namespace sprag
