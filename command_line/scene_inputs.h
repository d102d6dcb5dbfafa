// Checks of a scene's recorded inputs against what a program needs.
#pragma once

#include <string>

#include "sprag/scene.h"

namespace sprag {

/// Throws UsageError if the scene has a recorded input that ends before `duration` [s]. `option`:
/// the option of the program that gives it.
void require_inputs_until(const Scene& scene, double duration, const std::string& option);

/// Prints to stderr that a run up to t [s] goes beyond a recorded input of the scene, if it does.
void report_held_inputs(const Scene& scene, double t);

/// Throws UsageError if the scene has a recorded input, which `program` does not support.
void refuse_recorded_inputs(const Scene& scene, const std::string& program);

}  // namespace sprag
