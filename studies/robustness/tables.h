// The CSV files of docs/robustness.
#pragma once

#include <filesystem>
#include <vector>

#include "studies/robustness/studies.h"

namespace sprag::robustness {

struct Measured {
  Study study;
  std::vector<Point> points;
};

/// Writes floors.csv, slopes.csv, tolerances.csv and worse.csv. Throws std::runtime_error if not
/// everything could be written.
void write_tables(const std::filesystem::path& folder, const std::vector<Measured>& all);

}  // namespace sprag::robustness
