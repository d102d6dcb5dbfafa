// Sampled inputs in the tables [excitation] and [[force]] of a scene: keys file, record, time,
// acceleration, displacement, force, quantity, unit, interpolation, outside, uncertainty, gain and
// delay.
#pragma once

#include "sprag/detail/files/toml_reader.h"
#include "sprag/scene.h"

namespace sprag {

/// Whether the table has a key of a harmonic.
bool has_harmonic_keys(const TomlTable& table);

/// Whether the table has a recorded signal: a file, or the samples themselves.
bool has_record(const TomlTable& table);

/// Throws SceneError if the table has a gain or a delay, which need a record.
void refuse_record_keys(const TomlTable& table);

/// The record of [excitation], an acceleration or a displacement. Throws SceneError.
SampledInputPointer read_frame_input(const TomlTable& table);
/// The record of a [[force]]. Throws SceneError.
SampledInputPointer read_force_input(const TomlTable& table);

/// Supports on the ground under a recorded acceleration: adds a remark about their drift. Throws
/// SceneError if the samples have an uncertainty.
void check_ground_supports(const TomlTable& excitation, const Model& model);

/// Scene::stream_duration by the keys stream and stream_duration. Throws SceneError if the scene's
/// inputs cannot be streamed.
double read_stream(const TomlTable& excitation, const Scene& scene);

}  // namespace sprag
