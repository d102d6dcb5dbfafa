// What was found: as a table and in plain words, as JSON, as CSV.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tools/tolerance/search.h"

namespace sprag::tolerance {

/// "0.3 ms"; "> 20 ms": even the largest that was tried; "< 1 us": not even the least; "-": not
/// even where nothing is off.
std::string limit_text(const Deviation& deviation, const Limit& limit);

std::string to_text(const Bench& bench, const Tolerances& tolerances);
void write_json(const Bench& bench, const Tolerances& tolerances, nlohmann::ordered_json& object);

/// One row for each amount that was tried, and estimator:
/// what,unit,amount,estimator,median,low,high,worse. The first rows are of nothing that is off.
std::string to_csv(const Bench& bench, const Tolerances& tolerances);

}  // namespace sprag::tolerance
