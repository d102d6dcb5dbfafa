// The paper's beam in the variants that the studies need: other starts, wrong parameters, more
// modes.
#pragma once

#include <cstdint>
#include <string>

#include "sprag/files/scene_file.h"

namespace sprag::robustness {

/// Where the beam meets its support, which a Scene does not keep [m].
inline constexpr double contact_position = 0.868;

/// Throws SceneError if the scene is not a beam with its one contact there.
Scene read_paper_beam(const std::string& file);

/// The beam with as many modes; starts are cut or padded with zeros, the uncertainty is shared
/// anew.
Scene with_modes(const Scene& scene, int modes);

/// The scene with another start of its master, outside the support: normal deviates of each q_i,
/// 0.02 m of the first mode and as much energy in the second and third.
Scene with_random_start(Scene scene, std::uint64_t seed);

/// The parameters that can be wrong.
enum class Wrong { restitution, damping, stiffness, position, clearance, amplitude, phase };

/// The scene with one parameter off by `deviation`: a share of its value, but [m] for the clearance
/// and [rad] for the phase.
Scene with_wrong(Scene scene, Wrong wrong, double deviation);

}  // namespace sprag::robustness
