// An assessment for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/assessment.h"

namespace sprag {

/// Adds all figures, exact, and the findings. What is infinite is null.
void write_json(const Assessment& assessment, nlohmann::ordered_json& object);

}  // namespace sprag
