// Output of the results: as a table and in words, as JSON, as CSV.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sprag/detail/tolerance/search.h"

namespace sprag::tolerance {

/// "0.3 ms"; "> 20 ms": even the largest amount is tolerated; "< 1 us": not even the least; "-":
/// not even no deviation.
std::string limit_text(const Deviation& deviation, const Limit& limit);

std::string to_text(const Bench& bench, const Tolerances& tolerances);
void write_json(const Bench& bench, const Tolerances& tolerances, nlohmann::ordered_json& object);

/// One row for each amount and estimator: what,unit,amount,estimator,median,low,high,worse. The
/// first rows are without deviation.
std::string to_csv(const Bench& bench, const Tolerances& tolerances);

}  // namespace sprag::tolerance
