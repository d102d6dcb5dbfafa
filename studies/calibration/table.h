// Rows of the calibration study as a readable table, CSV and JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "studies/calibration/study.h"

namespace sprag::calibration {

/// With a line break at the end.
std::string table_header();
std::string table_row(const Row& row);
std::string csv_header();
std::string csv_row(const Row& row);

nlohmann::ordered_json to_json(const Row& row);

}  // namespace sprag::calibration
