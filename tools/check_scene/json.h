// An assessment as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/assessment.h"

namespace sprag {

/// Adds all figures without rounding, and the findings. Infinite figures are null.
void write_json(const Assessment& assessment, nlohmann::ordered_json& object);

}  // namespace sprag
