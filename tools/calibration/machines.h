// The machines of the calibration study: scenes, the paper's beam with more modes, random ones.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mechanics/scene.h"

namespace sprag::calibration {

/// The machines that are taken if none are named: twelve that are not the paper's beam.
std::vector<std::string> usual_machines();

/// Reads a scene file; or makes "modes:N", scenes/paper_beam.toml with N modes, or "random:SEED",
/// SEED >= 1. "random:1-40" are forty of them. Where the scene gives no uncertainty it gets three
/// times the V(0) of its starts, shared by all modes. Throws SceneError, or std::invalid_argument
/// if it makes no sense.
std::vector<Scene> machines(const std::string& name);

/// A scene file of a random machine: of odd seeds a beam of 2 to 8 modes, of even ones a chain of 2
/// to 5 masses between springs; shaken, with 1 to 3 contacts, which go on to be hit.
std::string random_scene(std::uint64_t seed);

/// A duration in which a machine comes to its usual motion and shows it: 120 periods of its slowest
/// mode or harmonic, to two digits. 0 if it has none.
double usual_duration(const Model& model);

/// Rounded to so many decimal digits; value > 0.
double to_digits(double value, int digits);

/// The highest natural frequency [rad per unit of time].
double highest_frequency(const Model& model);

}  // namespace sprag::calibration
