// An assessment for people and for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tools/check_scene/assessment.h"

namespace sprag {

/// Verdict, reasons and figures, four significant digits, at most 100 columns.
std::string to_text(const Assessment& assessment);

/// Adds all figures, exact, and the findings. What is infinite is null.
void to_json(const Assessment& assessment, nlohmann::ordered_json& object);

}  // namespace sprag
