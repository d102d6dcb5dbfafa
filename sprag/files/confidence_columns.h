// What an estimate says of its own error, as columns of a states CSV.
#pragma once

#include <string>
#include <vector>

#include "sprag/estimation/confidence.h"

namespace sprag {

/// Columns that hold a Confidence, behind those of the state; none where nothing is estimated. For
/// a bound alone: `B`, `closing_t`, `closing_contact`, `replica_gap`. `initial` is B(0).
/// Parameters have the columns `accepted` and, by their keys, `KEY` and `sigma_KEY`.
std::vector<std::string> confidence_columns(const Confidence& confidence, double initial);

/// The values in these columns; `values` keeps its room.
void to_columns(const Confidence& confidence, double initial, std::vector<double>& values);

}  // namespace sprag
