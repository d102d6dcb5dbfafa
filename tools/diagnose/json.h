// A diagnosis as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/detail/analysis/diagnosis.h"

namespace sprag {

/// Adds all figures without rounding.
void write_json(const Diagnosis& diagnosis, nlohmann::ordered_json& object);

}  // namespace sprag
