// The candidates of a reduction, or what an accuracy needs, as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sprag/detail/analysis/accuracy.h"
#include "sprag/detail/text/reduction_text.h"

namespace sprag {

/// Adds all figures without rounding. An infinite rms is null.
void write_json(const ReductionTable& table, nlohmann::ordered_json& object);
void write_json(const Accuracy& accuracy, nlohmann::ordered_json& object);

}  // namespace sprag
