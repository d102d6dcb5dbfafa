// An identification as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/detail/text/identification_text.h"

namespace sprag {

/// Adds all figures without rounding.
void write_json(const IdentifyResult& result, nlohmann::ordered_json& object);

}  // namespace sprag
