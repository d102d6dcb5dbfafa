// The machines of the calibration study: scenes, the paper's beam with more modes, random ones.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sprag/scene_file.h"

namespace sprag::calibration {

/// Default machines: twelve others than the paper's beam.
std::vector<std::string> usual_machines();

/// Reads a scene file, or makes "modes:N", scenes/paper_beam.toml with N modes, or a random
/// machine: "random:SEED", which is hit, or "chatter:SEED", which chatters, with SEED >= 1.
/// "random:1-40" names forty machines. A scene without uncertainty gets three times the V(0) of its
/// starts, shared equally by all modes. Throws SceneError, or std::invalid_argument for an invalid
/// name.
std::vector<Scene> machines(const std::string& name);

enum class Kind {
  hit,  ///< shaken, 1 to 3 contacts: odd seeds beams of 2 to 8 modes, even ones chains of 2 to
        ///< 5 masses between springs
  chattering  ///< odd seeds beams that swing freely on a support, even ones chains that are pressed
              ///< against 1 to 3 and shaken
};

/// A scene file of a random machine whose contacts are hit until the end.
std::string random_scene(Kind kind, std::uint64_t seed);

/// A duration that contains the transient and the long-run motion: 120 periods of the machine's
/// slowest mode or harmonic, to two digits. 0 if it has none.
double usual_duration(const Model& model);

/// Rounded to `digits` decimal digits; value > 0.
double to_digits(double value, int digits);

/// The highest natural frequency [rad per unit of time].
double highest_frequency(const Model& model);

}  // namespace sprag::calibration
