// Data of the charts of docs/measurements/identification.md as CSV files: the largest parameter
// errors of a scene that identification corrects, and its errors relative to the Cramer-Rao bound.
#pragma once

#include <cstdint>
#include <filesystem>

namespace sprag::identification_study {

/// Writes basin.csv and bound.csv to `directory`, from runs of scenes/paper_beam.toml with seeds
/// from `first_seed` on. Throws SceneError if the scene cannot be read, and std::runtime_error if a
/// file cannot be written.
void write_chart_data(const std::filesystem::path& scenes, const std::filesystem::path& directory,
                      std::uint64_t first_seed);

}  // namespace sprag::identification_study
