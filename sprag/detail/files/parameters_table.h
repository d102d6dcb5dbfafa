// The table [parameters] of a scene file: the uncertainty of parameters of its machine.
#pragma once

#include "sprag/detail/files/toml_reader.h"
#include "sprag/scene.h"

namespace sprag {

/// The parameters of [parameters] of the document `root`, in the order of the file; empty without
/// that table. Throws SceneError for a parameter that the scene's machine does not have or a filter
/// cannot estimate, a standard deviation that is not positive, and correlations that are not
/// positive semidefinite.
ParameterUncertainty read_parameters(const TomlTable& root, const Scene& scene);

}  // namespace sprag
