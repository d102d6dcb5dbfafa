// The table [parameters] of a scene file: how uncertain parameters of its machine are.
#pragma once

#include "sprag/detail/files/toml_reader.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Reads [parameters] of the document `root`; empty where there is none.
/// \param scene has the machine, whose parameters the table names.
/// \return the parameters in the order of the file.
/// \throws SceneError for a parameter that the machine does not have or a filter cannot follow, a
/// standard deviation that is not positive, and correlations that no distribution has.
ParameterUncertainty read_parameters(const TomlTable& root, const Scene& scene);

}  // namespace sprag
