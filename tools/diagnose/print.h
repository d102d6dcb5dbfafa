// A diagnosis for people and for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tools/diagnose/diagnosis.h"

namespace sprag {

/// What follows from it, in words.
std::string verdict(const Diagnosis& diagnosis);

/// Verdict and a table of the parameters, the best first, at most 100 columns.
std::string to_text(const Diagnosis& diagnosis);

/// Adds all figures, exact.
void write_json(const Diagnosis& diagnosis, nlohmann::ordered_json& object);

}  // namespace sprag
