// Single numbers of a scene by their keys in the scene file: contact.2.clearance, system.M.1.2,
// force.1.direction.3, beam.length.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>

#include "sprag/scene.h"

namespace sprag {

/// Place of a number in a scene and its copies.
struct SceneNumber {
  std::string_view unit;
  double* (*at)(Scene& scene, Eigen::Index i, Eigen::Index j);  ///< null: no such number
  Eigen::Index i = 0, j = 0;                                    ///< numbers of the key, from 0
  bool symmetric = false;                                       ///< of a symmetric matrix
  double value = 0.0;                                           ///< in the scene

  /// Sets the number, and of a symmetric matrix its mirror image, in a copy of the scene.
  void set(double to, Scene& scene) const;
};

/// The number with this key; nullopt if the scene has none: with system.modes none of the given
/// coordinates.
std::optional<SceneNumber> scene_number(Scene scene, std::string_view key);

/// Renews what follows from numbers of the scene: M, C, K and the directions of a beam, and the
/// force and the ground's motion of a shaken frame. `scene` is a copy of `nominal` with other
/// numbers; contacts of a beam keep their w. Does not allocate.
void update_from(const Scene& nominal, Scene& scene);

/// The word of a key that says what it is of: "restitution" of contact.1.restitution.value, "slope"
/// of contact.1.restitution.slope, "K" of system.K.1.2.
std::string_view quantity(std::string_view key);

/// Whether a key is of the amplitude, the frequency or the phase of a harmonic or of several.
bool is_of_harmonic(std::string_view key);

/// Whether a key is of a single entry of a matrix or a vector.
bool is_of_entry(std::string_view key);

}  // namespace sprag
