// Output of a diagnosis as text and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sprag/detail/analysis/diagnosis.h"

namespace sprag {

/// The verdict in words.
std::string verdict(const Diagnosis& diagnosis);

/// Verdict and a table of the parameters, the best first, at most 100 columns.
std::string to_text(const Diagnosis& diagnosis);

/// Adds all figures without rounding.
void write_json(const Diagnosis& diagnosis, nlohmann::ordered_json& object);

}  // namespace sprag
