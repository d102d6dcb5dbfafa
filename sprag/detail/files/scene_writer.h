// Writes a scene as a scene file (TOML), every number with all its digits.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/scene.h"

namespace sprag {

/// The restitutions at the points of a piecewise linear curve, as scene files give them.
Eigen::VectorXd restitutions_at_points(const Contact& contact);

/// The text of a scene file that parse_scene() reads as the same scene, bit for bit. Recorded
/// inputs are written with their samples. A beam whose keys do not give its matrices becomes a
/// system without [adapt] and [parameters], since their keys may be those of the beam. Kept modes
/// become a system of their coordinates. `comment`: lines at the beginning, without '#'. Throws
/// SceneError for a streamed input.
std::string to_toml(const Scene& scene, std::string_view comment = "");

/// The table [parameters] of a scene file, empty without parameters. `comment`: a line in it,
/// without '#'.
std::string to_toml(const ParameterUncertainty& parameters, std::string_view comment = "");

/// The table [tolerance], empty if all tolerances are zero. `comment` is one line.
std::string to_toml(const Tolerance& tolerance, std::string_view comment = "");

/// Writes a scene to a file. Throws Error if the file cannot be written.
void write_scene(const std::filesystem::path& file, const Scene& scene,
                 std::string_view comment = "");

}  // namespace sprag
