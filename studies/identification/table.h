// The trials of docs/measurements/identification.md, as a table: what was wanted of each and what
// was got.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace sprag::identification_study {

/// Runs the trials whose names contain `only` on the scenes in `scenes`, with seeds from
/// `first_seed` on, and a table of drifts if that is empty or "drift". The tables go to stdout, the
/// runs that failed to stderr. Throws SceneError where a scene cannot be read.
void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed,
                 const std::string& only);

}  // namespace sprag::identification_study
