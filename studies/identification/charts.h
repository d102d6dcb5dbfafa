// What the charts of docs/measurements/identification.md show, as CSV files: how far off a scene
// may be for its parameters to be found, and how near to the least possible errors they come.
#pragma once

#include <cstdint>
#include <filesystem>

namespace sprag::identification_study {

/// Writes basin.csv and bound.csv to `directory`, from runs of scenes/paper_beam.toml with seeds
/// from `first_seed` on. Throws SceneError where the scene cannot be read, and std::runtime_error
/// where a file cannot be written.
void write_chart_data(const std::filesystem::path& scenes, const std::filesystem::path& directory,
                      std::uint64_t first_seed);

}  // namespace sprag::identification_study
