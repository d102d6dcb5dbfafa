// The trials of docs/measurements/identification.md as a table: the setup and the result of each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace sprag::identification_study {

/// Runs the trials whose names contain `only` on the scenes in `scenes`, with seeds from
/// `first_seed` on, and a table of drifts if `only` is empty or "drift". The tables go to stdout,
/// the failed runs to stderr. Throws SceneError if a scene cannot be read.
void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed,
                 const std::string& only);

}  // namespace sprag::identification_study
