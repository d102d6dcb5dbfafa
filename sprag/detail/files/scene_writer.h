// Writes a scene as a scene file (TOML): any machine as a general [system], every number with all
// its digits.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/scene.h"

namespace sprag {

/// The text of a scene file that parse_scene() reads as the same scene, bit for bit; but a beam
/// becomes a system, without [adapt] and [parameters], whose keys may be the beam's. `comment`:
/// lines that go before, without '#'.
std::string to_toml(const Scene& scene, std::string_view comment = "");

/// The table [parameters] of a scene file, empty where there are none. `comment`: a line in it,
/// without '#'.
std::string to_toml(const ParameterUncertainty& parameters, std::string_view comment = "");

/// The table [tolerance]; empty where nothing may be off. `comment` is one line.
std::string to_toml(const Tolerance& tolerance, std::string_view comment = "");

/// Writes it to a file. Throws std::runtime_error if that cannot be written.
void write_scene(const std::filesystem::path& file, const Scene& scene,
                 std::string_view comment = "");

}  // namespace sprag
